// A microcontroller's whole program: say what it is, take the parameters, serve ticks, say how it ended.
#pragma once

#include "hal/control_loop.h"
#include "hal/target/link_board.h"

namespace ballast::hal::target {

// Bytes came that are no frame, or a message out of turn: what was not understood cannot be answered.
template <Machine M>
Status give_up(Link<M>& link, std::int64_t tick) {
  LastWords words;
  words.cause = Cause::kLink;
  static_cast<void>(link.send(words, tick));
  return Status::kIo;
}

// Until the parameters are here, accepted, and the ticks run. kOk: they are. kEmpty: refused, and the host told why.
template <Machine M>
Status take_params(M& machine, Link<M>& link, const Identity& identity, firmware::ControllerParams& params) {
  static MassParams mass;
  Hello hello;
  hello.identity = identity;
  hello.board = M::kName;
  hello.counter_hz = M::kCounterHz;
  if (const Status s = link.send(hello, 0); s != Status::kOk) return s;

  Frame frame;
  if (const Status s = link.receive(frame); s != Status::kOk) return s;
  if (!decode(frame, params)) return Status::kIo;
  int masses = 0;
  Verdict verdict;
  for (;;) {
    if (const Status s = link.receive(frame); s != Status::kOk) return s;
    if (frame.type != MessageType::kMass) break;
    if (!decode(frame, mass)) return Status::kIo;
    if (masses >= params.ball.mass_count) return Status::kIo;
    if (!set_mass(mass, masses, params) && verdict.acceptance == Acceptance::kAccepted) {
      verdict.acceptance = Acceptance::kMotion;
      verdict.index = masses;
    }
    ++masses;
  }
  Commit commit;
  if (!decode(frame, commit)) return Status::kIo;

  verdict.fingerprint = fingerprint(params);
  if (masses != params.ball.mass_count) {
    verdict.acceptance = Acceptance::kIncomplete;
  } else if (verdict.acceptance == Acceptance::kAccepted) {
    if (const firmware::ParamError error = firmware::validate(params); !error.ok()) {
      verdict.acceptance = Acceptance::kRefused;
      verdict.field = error.field;
      verdict.index = error.index;
      verdict.piece = error.piece;
      verdict.value = error.value;
      verdict.limit = error.limit;
      verdict.allowed = error.allowed;
    } else if (!machine.start(params, commit)) {
      verdict.acceptance = Acceptance::kPeriod;
      verdict.value = params.control_period_s;
    }
  }
  if (const Status s = link.send(verdict, 0); s != Status::kOk) return s;
  return verdict.acceptance == Acceptance::kAccepted ? Status::kOk : Status::kEmpty;
}

// `Loop` is ControlLoop, or something around it. Returns when there is nothing more to do, and why.
template <template <Board> class Loop = ControlLoop, Machine M>
Status serve(M& machine, const Identity& identity) {
  static firmware::ControllerParams params;
  static Link<M> link(machine);
  static LinkBoard<M> board(machine, link);

  Status status = take_params(machine, link, identity, params);
  if (status == Status::kIo) return give_up(link, 0);
  if (status != Status::kOk) return status;

  static Loop<LinkBoard<M>> loop(params, board);
  status = loop.run();
  if (status == Status::kIo) return give_up(link, board.tick());
  if (status != Status::kEnded) return status;
  static Farewell farewell;
  farewell.overruns = board.overruns();  // before the next tick begins
  // The last tick's pulses are given before anything is said about them.
  static_cast<void>(machine.wait_tick());
  farewell.status = status;
  farewell.counters = board.counters();
  farewell.watchdog_kicks = board.watchdog_kicks();
  machine.played(farewell.played);
  machine.report(farewell);
  static_cast<void>(link.send(farewell, board.tick()));
  return status;
}

}  // namespace ballast::hal::target
