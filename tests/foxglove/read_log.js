// node read_log.js FILE.mcap: per topic its schema, number of messages, first and last message, as Foxglove reads them.
const { open } = require("node:fs/promises");
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");
const { plain, readerOf } = require("./messages.js");

(async () => {
  const readable = new FileHandleReadable(await open(process.argv[2]));
  const log = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
  const readers = new Map();
  const topics = {};
  for await (const message of log.readMessages()) {
    const channel = log.channelsById.get(message.channelId);
    const schema = log.schemasById.get(channel.schemaId);
    if (!readers.has(channel.id)) readers.set(channel.id, readerOf(schema));
    const { reader, differences } = readers.get(channel.id);
    const content = plain(reader.readMessage(message.data));
    const topic = (topics[channel.topic] ??= { schema: schema.name, differences, count: 0, first: content });
    topic.count += 1;
    topic.last = content;
  }
  console.log(JSON.stringify(topics));
})();
