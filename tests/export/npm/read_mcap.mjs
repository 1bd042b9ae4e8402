// read_mcap.mjs FILE: prints what @mcap/core reads, a line of JSON each: channels, then messages in order of time.
import {McapIndexedReader} from "@mcap/core";
import {open} from "node:fs/promises";

const file = await open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    await file.read(bytes, 0, Number(length), Number(offset));
    return bytes;
  }
};
const reader = await McapIndexedReader.Initialize({readable});
const decoder = new TextDecoder();
for (const {topic, messageEncoding, schemaId} of reader.channelsById.values()) {
  const {name, encoding, data} = reader.schemasById.get(schemaId);
  console.log(JSON.stringify({topic, messageEncoding, name, encoding, schema: decoder.decode(data)}));
}
for await (const {channelId, logTime, publishTime, data} of reader.readMessages({validateCrcs: true})) {
  const {topic} = reader.channelsById.get(channelId);
  const times = `"logTime":${logTime},"publishTime":${publishTime}`;
  console.log(`{"topic":${JSON.stringify(topic)},${times},"message":${decoder.decode(data)}}`);
}
await file.close();
