// A microcontroller's whole program: it introduces itself, takes the parameters, serves ticks and reports how it ended.
#pragma once

#include "hal/control_loop.h"
#include "hal/target/link_board.h"

namespace ballast::hal::target {

// Reports bytes that are no frame, or a message out of turn, and ends.
template <Machine M>
Status give_up(Link<M>& link, std::int64_t tick) {
  FaultReport report;
  report.cause = Cause::kLink;
  static_cast<void>(link.send(report, tick));
  return Status::kIo;
}

// Takes the parameters and starts the ticks. kOk: the ticks run. kEmpty: the parameters were refused, and the reason
// was sent to the host. `prepare()` is called with valid parameters before the ticks begin: it may take longer than
// one.
template <Machine M, class Prepare>
Status take_params(M& machine, Link<M>& link, const Identity& identity, firmware::ControllerParams& params,
                   Prepare prepare) {
  static MassParams mass;
  static ReferencePart part;
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
  const int values = reference_values(params);
  int taken = 0;
  for (; frame.type == MessageType::kReference; taken += part.count) {
    if (!decode(frame, part) || !set_reference(part, taken, values, params.tracking)) return Status::kIo;
    if (const Status s = link.receive(frame); s != Status::kOk) return s;
  }
  Commit commit;
  if (!decode(frame, commit)) return Status::kIo;

  verdict.fingerprint = fingerprint(params);
  if (masses != params.ball.mass_count || taken != values) {
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
    } else {
      prepare();
      if (!machine.start(params, commit)) {
        verdict.acceptance = Acceptance::kPeriod;
        verdict.value = params.control_period_s;
      }
    }
  }
  if (const Status s = link.send(verdict, 0); s != Status::kOk) return s;
  return verdict.acceptance == Acceptance::kAccepted ? Status::kOk : Status::kEmpty;
}

// `Loop` is ControlLoop or a wrapper of it. Returns how the program ended.
template <template <Board> class Loop = ControlLoop, Machine M>
Status serve(M& machine, const Identity& identity) {
  static firmware::ControllerParams params;
  static Link<M> link(machine);
  static LinkBoard<M> board(machine, link);

  // The controller certifies the first start as it begins, which takes many ticks' time.
  Loop<LinkBoard<M>>* loop = nullptr;
  const auto prepare = [&loop] {
    static Loop<LinkBoard<M>> begun(params, board);
    loop = &begun;
  };
  Status status = take_params(machine, link, identity, params, prepare);
  if (status == Status::kIo) return give_up(link, 0);
  if (status != Status::kOk) return status;

  status = loop->run();
  if (status == Status::kIo) return give_up(link, board.tick());
  if (status != Status::kEnded) return status;
  static EndReport end_report;
  end_report.overruns = board.overruns();  // before the next tick begins
  // Waits until the last tick's pulses were given.
  static_cast<void>(machine.wait_tick());
  end_report.status = status;
  end_report.counters = board.counters();
  end_report.watchdog_kicks = board.watchdog_kicks();
  machine.played(end_report.played);
  machine.report(end_report);
  static_cast<void>(link.send(end_report, board.tick()));
  return status;
}

}  // namespace ballast::hal::target
