// The websocket to the server. It connects again whenever it is lost.

const SUBPROTOCOL = "ballast.live.v1";
const FIRST_WAIT_MS = 500, LONGEST_WAIT_MS = 5000;
const TRY_AGAIN_LATER = 1013;

export class Connection {
  // `take` maps each "op" to a function of its message. `changed(open, reason)` is told of the connection.
  constructor(take, changed) {
    Object.assign(this, {take, changed});
    this.wait = FIRST_WAIT_MS;
    this.received = 0;  // messages
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}${location.pathname}`, SUBPROTOCOL);
    this.socket.addEventListener("open", () => {
      this.wait = FIRST_WAIT_MS;
      this.changed(true, "");
    });
    this.socket.addEventListener("message", ({data}) => {
      ++this.received;
      const message = JSON.parse(data);
      this.take[message.op]?.(message);
    });
    this.socket.addEventListener("close", ({code, reason}) => {
      this.changed(false, code === TRY_AGAIN_LATER ? reason : "");
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    });
  }

  send(op, fields = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({op, ...fields}));
    return true;
  }
}
