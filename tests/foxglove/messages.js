// What Foxglove makes of a ros2msg schema, and whether that is the definition it knows under that name.
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { ros2humble } = require("@foxglove/rosmsg-msgs-common");

const fields = (definition) =>
  definition.definitions
    .filter((field) => !field.isConstant)
    .map((field) => `${field.type.replace("/msg/", "/")}${field.isArray ? "[]" : ""} ${field.name}`)
    .join("; ");

exports.readerOf = (schema) => {
  const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
  const differences = [];
  for (const definition of definitions) {
    const name = (definition.name ?? schema.name).replace("/msg/", "/");
    const known = ros2humble[name] ?? ros2humble[name.replace("/", "/msg/")];
    if (known === undefined) differences.push(`${name}: Foxglove does not know it`);
    else if (fields(known) !== fields(definition)) differences.push(`${name}: ${fields(definition)}, not ${fields(known)}`);
  }
  return { reader: new MessageReader(definitions), differences };
};

exports.plain = (message) =>
  JSON.parse(
    JSON.stringify(message, (_, value) =>
      ArrayBuffer.isView(value) ? { length: value.length } : typeof value === "bigint" ? Number(value) : value,
    ),
  );
