// The panels to plot, each with its lines, limits and marks. plots.js draws them.
//
// panel: {id, title (HTML), unit, lines, bands, limits, extremes, top, bottom, noise, flags (whether they are drawn)}
// line: {run, column, label (HTML; none: not in the legend), color (of theme.js), dash, width}
// band: {run, column (its middle; none: 0), sigma (column), color}; it reaches BAND_SIGMAS sigma to either side
// top, bottom: the axis ends there, because values beyond them are not meaningful.
// noise: values below this are rounding errors of 0, which the axis does not magnify.

import {shortNumber} from "ballast/numbers.js";

const DASHED = [6, 4];
export const BAND_SIGMAS = 2;

const sub = (symbol, index) => `<i>${symbol}</i><sub>${index}</sub>`;
export const FRICTION = sub("f", "s");
export const FRICTION_LIMIT = sub("μ", "s");
const NEEDED = `${FRICTION}/<i>N</i>`;

export const runLetter = (run) => "AB"[run];

// One line per run. A single run has the quantity's colour; of two runs, each has its own.
function single(runs, column, label, color) {
  const lines = [];
  runs.forEach(({samples, described}, run) => {
    const several = runs.length > 1;
    const line = {
      run,
      label: several ? runLetter(run) : label,
      color: several ? `run-${run}` : color,
      width: several && run === 0 ? 2.6 : 1.3  // where both are equal, the wider one shows behind the other
    };
    if (samples.has(column)) lines.push({...line, column});
    if (column === "mu_required" && samples.has("floor_friction"))
      lines.push({
        ...line,
        column: "floor_friction",
        label: `${FRICTION_LIMIT} under the ball`,
        color: "limit",
        dash: [7, 4],
        width: 1
      });
    const commanded = `commanded_${column}`;
    if (!several && samples.has(commanded))
      lines.push({...line, column: commanded, label: described.commanded, color: "text", dash: DASHED, width: 1});
    const planned = `planned_${column}`;
    if (!several && samples.has(planned))
      lines.push({...line, column: planned, label: "planned", color: "good", dash: [2, 3], width: 1.6});
    const believed = `believed_${column}`;
    if (!several && samples.has(believed))
      lines.push({...line, column: believed, label: "the believed robot", color: "believed", dash: [9, 3], width: 1.6});
  });
  return lines;
}

// One line per component. The second run's lines are dashed.
function several(runs, column, count, label, color) {
  const lines = [];
  runs.forEach(({samples}, run) => {
    for (let j = 0; j < count(run); ++j) {
      if (!samples.has(`${column}_${j}`)) continue;
      const name = runs.length > 1 ? `${runLetter(run)} ${label(j)}` : label(j);
      lines.push(
          {run, column: `${column}_${j}`, label: name, color: color(j), dash: run ? DASHED : undefined, width: 1.4});
    }
  });
  return lines;
}

const finite = (values) => values.filter(Number.isFinite);

// Near N = 0 f_s/N grows without bound, and an axis up to there would flatten everything else.
function neededTop(runs) {
  const tops = runs.map(({samples, described}) => {
    const values = finite(samples.get("mu_required")).sort();
    const usual = values.length ? 4 * values[Math.floor(0.9 * (values.length - 1))] : 0;
    return Math.max(usual, 1.5 * (described.static_friction ?? 0));
  });
  return Math.max(...tops) || 1;
}

function frictionLimits(runs) {
  const limits = [];
  runs.forEach(({described}, run) => {
    const limit = described.static_friction;
    if (limit === null || described.friction_changes) return;  // a line of its own
    const who = runs.length > 1 ? ` ${runLetter(run)}` : "";
    const add = (value, text) => {
      if (!limits.some((other) => other.value === value)) limits.push({value, text});
    };
    add(limit, `μs${who} = ${shortNumber(limit)}`);
    const use = described.envelope?.friction_use ?? 1;
    if (described.plan_may_use)
      add(described.plan_may_use, `a plan may use${who} ${shortNumber(described.plan_may_use)}`);
    if (use < 1) add(use * limit, `monitor's limit${who} ${shortNumber(use * limit)}`);
  });
  return limits;
}

const occurs = (runs, name) => runs.some(({described}) => described.regimes.some(({regime}) => regime === name));

function contactPanels(runs) {
  const slides = occurs(runs, "sliding");
  const perfect = runs.every(({described}) => described.friction_known && described.static_friction === null);
  const leastNormal = runs.map(({described}) => described.envelope?.min_normal_force ?? 0);
  const extremes = (column) =>
      runs.flatMap(({described}, run) => (described.extremes[column] ? [{run, ...described.extremes[column]}] : []));

  return [
    {
      id: "normal_force",
      title: "Normal force <i>N</i>",
      unit: "N",
      lines: single(runs, "normal_force", "<i>N</i>", "force"),
      extremes: extremes("normal_force"),
      limits: [...new Set(leastNormal)].map((value) => ({value, text: value ? `limit ${value}` : ""}))
    },
    {
      id: "static_friction",
      title: `${slides ? "Friction" : "Static friction"} ${FRICTION}`,
      unit: "N",
      lines: single(runs, "static_friction", FRICTION, "friction"),
      extremes: extremes("static_friction"),
      noise: 1e-9 * Math.max(...runs.map(({samples}) => Math.max(...finite(samples.get("normal_force")))))
    },
    {
      id: "mu_required",
      title: `Friction coefficient ${slides ? "needed; kinetic where it slides" : "needed"} ${NEEDED}`,
      unit: "",
      lines: single(runs, "mu_required", NEEDED, "needed"),
      extremes: extremes("mu_required"),
      limits: frictionLimits(runs),
      top: neededTop(runs),
      noise: 1e-9
    },
    {
      id: "margin",
      title: `Margin 1 − ${FRICTION}/(${FRICTION_LIMIT}<i>N</i>)${perfect ? ": friction is perfect" : ""}`,
      unit: "",
      lines: single(runs, "margin", "margin", "margin"),
      limits: [{value: 0, text: ""}],
      bottom: -1.1
    },
  ];
}

// The band of each component of a quantity, or one band around 0 where all share it.
function bands(runs, column, count, color) {
  const found = [];
  runs.forEach(({samples}, run) => {
    if (!samples.has(`${column}_sigma`)) return;
    for (let j = 0; j < count; ++j)
      found.push(
          {run, column: count > 1 ? `${column}_${j}` : undefined, sigma: `${column}_sigma`, color: color(j, run)});
  });
  return found;
}

// Says how much of the time the truth was inside the band; of two runs, of each.
function withNote(runs, id, title) {
  const said = runs.flatMap(({described}, run) => {
    const note = described.notes?.[id];
    return note ? [runs.length > 1 ? `${runLetter(run)}: ${note}` : note] : [];
  });
  return said.length ? `${title} <small>${said.join("; ")}</small>` : title;
}

// Panels of the contact with the floor as the robot measures it.
function measuredPanels(runs) {
  const whose = (run) => (runs.length > 1 ? `run-${run}` : "estimate");
  const lines = (column) => runs.flatMap(({samples}, run) => {
    if (!samples.has(`measured_${column}`)) return [];
    const who = runs.length > 1 ? `${runLetter(run)} ` : "";
    // The truth comes last and thin: where the masses ring, it would be hidden.
    return [
      {run, column: `measured_${column}`, label: `${who}measured`, color: whose(run), width: 1.3},
      {run, column, label: `${who}true`, color: "text", width: 0.6, dash: run ? DASHED : undefined}
    ];
  });
  const around = (column) => runs.flatMap(
      ({samples}, run) => samples.has(`measured_${column}`) ?
          [{run, column: `measured_${column}`, sigma: `measured_${column}_sigma`, color: whose(run)}] :
          []);
  const error = (id, title, unit) => ({
    id,
    title: withNote(runs, id, title),
    unit,
    limits: [{value: 0, text: ""}],
    lines: several(runs, id, () => 1, () => "error", (j) => `axis-${j}`),
    bands: bands(runs, id, 1, (j, run) => (runs.length > 1 ? `run-${run}` : "muted")),
    flags: true
  });
  const slip = [];
  runs.forEach(({samples}, run) => {
    if (samples.has("measured_slip"))
      slip.push({
        run,
        column: "measured_slip",
        label: runs.length > 1 ? runLetter(run) : "measured",
        color: whose(run),
        width: 1.2
      });
  });
  return [
    {
      id: "measured_mu_required",
      title: `${NEEDED} as the robot measures it`,
      unit: "",
      lines: lines("mu_required"),
      bands: around("mu_required"),
      limits: frictionLimits(runs),
      top: neededTop(runs),
      flags: true
    },
    error("measured_mu_error", `${NEEDED}: measured − true`, ""),
    {
      id: "measured_normal_force",
      title: "<i>N</i> as the robot measures it",
      unit: "N",
      lines: lines("normal_force"),
      bands: around("normal_force"),
      flags: true
    },
    error("measured_normal_error", "<i>N</i>: measured − true", "N"),
    {
      id: "measured_slip",
      title: `Slip as the robot measures it <small>band: noise, ${BAND_SIGMAS}σ</small>`,
      unit: "m/s²",
      lines: slip,
      bands: slip.map(({run}) => ({run, sigma: "measured_slip_sigma", color: "muted"})),
      bottom: 0,
      flags: true
    },
  ];
}

// The errors of what the robot estimates, with the band that it states.
function estimatePanels(runs) {
  const axis = (j) => `axis-${j}`, about = (j) => `about ${sub("e", j + 1)}`, along = (j) => `along ${sub("e", j + 1)}`;
  const whose = (j, run) => (runs.length > 1 ? `run-${run}` : "muted");
  const zero = [{value: 0, text: ""}];
  const bias = several(runs, "gyro_bias", () => 3, (j) => sub("b", j + 1), axis);
  if (runs.length === 1)
    for (const line of several(runs, "true_gyro_bias", () => 3, () => "", axis))
      bias.push({...line, label: undefined, dash: [4, 3], width: 1.1});
  return [
    {
      id: "tilt_error",
      title: withNote(runs, "tilt_error", "Tilt: estimate − truth"),
      unit: "°",
      limits: zero,
      lines: several(runs, "tilt_error", () => 2, about, axis),
      bands: bands(runs, "tilt_error", 1, whose)
    },
    {
      id: "yaw_error",
      title: withNote(runs, "yaw_error", "Yaw: estimate − truth"),
      unit: "°",
      limits: zero,
      lines: several(runs, "yaw_error", () => 1, () => about(2), axis),
      bands: bands(runs, "yaw_error", 1, whose)
    },
    {
      id: "gyro_bias",
      title:
          withNote(runs, "gyro_bias", `Gyro bias, body frame${runs.length === 1 ? "; dashed: true, mean of 4 s" : ""}`),
      unit: "°/s",
      lines: bias,
      bands: runs.length === 1 ? bands(runs, "gyro_bias", 3, axis) : []
    },
    {
      id: "place_error",
      title: withNote(runs, "place_error", "Place: estimate − truth"),
      unit: "m",
      limits: zero,
      lines: several(runs, "place_error", () => 2, along, axis),
      bands: bands(runs, "place_error", 1, whose)
    },
  ];
}

function massPanels(runs) {
  const masses = (run) => runs[run].described.masses.length;
  const mass = (j) => `mass-${j}`, massName = (j) => `mass ${j}`;  // masses count from 0, as on the command line
  const withoutMotors = runs.every(({described}) => described.actuation !== "stepper");
  const positions = several(runs, "mass_position", masses, massName, mass);
  if (runs.length === 1)
    for (const line of several(runs, "commanded", masses, () => "", mass))
      positions.push({...line, label: undefined, color: "text", dash: [4, 4], width: 1});
  const commanded = runs.length === 1 && runs[0].samples.has("commanded_0");
  return [
    {
      id: "mass_position",
      title: `Masses: place on the rail${commanded ? "; dashed: commanded" : ""}`,
      unit: "rad, or m",
      lines: positions
    },
    {
      id: "deviation",
      title: "Masses: true − commanded",
      unit: "rad, or m",
      limits: [{value: 0, text: ""}],
      lines: several(runs, "deviation", masses, massName, mass)
    },
    {
      id: "motor_torque",
      title: `Motor torque ${withoutMotors ? "needed " : ""}at the shaft`,
      unit: "N m",
      lines: several(runs, "motor_torque", masses, massName, mass)
    },
    {
      id: "motor_margin",
      title: "Motor torque margin",
      unit: "%",
      limits: [{value: 0, text: ""}],
      bottom: -110,
      lines: several(runs, "motor_margin", masses, massName, mass)
    },
  ];
}

export function makePanels(runs) {
  const panels = [
    ...contactPanels(runs),
    ...measuredPanels(runs),
    ...estimatePanels(runs),
    {
      id: "governor",
      title: "Governor: 1 bent the command, 2 on the backup",
      unit: "",
      limits: [{value: 0, text: ""}],
      top: 2.2,
      lines: single(runs, "governor", "governor", "needed")
    },
    {
      id: "believed_off",
      title: "Place: real − believed",
      unit: "m",
      limits: [{value: 0, text: ""}],
      lines: several(runs, "believed_off", () => 2, (j) => `along ${sub("e", j + 1)}`, (j) => `axis-${j}`)
    },
    {
      id: "angular_velocity",
      title: "Angular velocity <b>Ω</b>, body frame",
      unit: "rad/s",
      lines: several(runs, "angular_velocity", () => 3, (j) => sub("Ω", j + 1), (j) => `axis-${j}`)
    },
    ...massPanels(runs),
  ];
  if (occurs(runs, "flight"))
    panels.push({
      id: "height",
      title: "Height of the centre above contact",
      unit: "m",
      lines: single(runs, "position_2", "height", "needed")
    });
  return panels.filter(({lines}) => lines.length > 0);
}
