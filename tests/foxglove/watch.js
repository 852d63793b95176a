// node watch.js PORT TOPICS: a client of Foxglove's; prints a line when it is connected, and ends when every one of the
// comma-separated topics has given a message, with the first one of each.
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");
const { plain, readerOf } = require("./messages.js");

const [, , port, wanted] = process.argv;
const missing = new Set(wanted.split(","));
const found = {};
const subscribed = new Map();
const client = new FoxgloveClient({ ws: new WebSocket(`ws://127.0.0.1:${port}`, ["foxglove.sdk.v1"]) });
client.on("error", (error) => console.log(JSON.stringify({ error: String(error.message ?? error) })));
client.on("serverInfo", (info) => console.log(JSON.stringify({ server: info.name, capabilities: info.capabilities })));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    if (!missing.has(channel.topic)) continue;
    const schema = { name: channel.schemaName, data: new TextEncoder().encode(channel.schema) };
    subscribed.set(client.subscribe(channel.id), { channel, ...readerOf(schema) });
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { channel, reader, differences } = subscribed.get(subscriptionId);
  found[channel.topic] ??= {
    schema: channel.schemaName,
    differences,
    stamp: String(timestamp),
    first: plain(reader.readMessage(data)),
  };
  missing.delete(channel.topic);
  if (missing.size === 0) {
    console.log(JSON.stringify(found));
    process.exit(0);
  }
});
