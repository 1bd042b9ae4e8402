// view_live.mjs URL SUBPROTOCOL: a viewer by Foxglove's own client. Subscribes to all channels, and prints what comes, a
// line of JSON each, until the server closes.
import client from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, subprotocol] = process.argv.slice(2);
const viewer = new client.FoxgloveClient({ws: new WebSocket(url, [subprotocol])});
const topics = new Map(), decoder = new TextDecoder();
const print = (entry) => console.log(JSON.stringify(entry));
viewer.on("serverInfo", (info) => print({info}));
viewer.on("status", (status) => print({status}));
viewer.on("error", (error) => print({error: error.message}));
viewer.on("advertise", (channels) => {
  print({channels});
  for (const {id, topic} of channels) topics.set(viewer.subscribe(id), topic);
});
viewer.on("time", ({timestamp}) => console.log(`{"time":${timestamp}}`));
viewer.on("message", ({subscriptionId, timestamp, data}) => {
  const topic = JSON.stringify(topics.get(subscriptionId));
  console.log(`{"topic":${topic},"logTime":${timestamp},"message":${decoder.decode(data)}}`);
});
viewer.on("close", () => process.exit(0));
