"""Plans a motion to a place, and tracks it with a robot whose ball is lighter than it believes."""
import ballast

BALL = {"radius": 0.15, "mass": 0.8, "inertia": [0.01176] * 3}
MOTOR = {"preset": "nema17", "gear_ratio": 4.0, "viscous_damping": 0.02}


def ring(radius, center, across):
    """A mass that hangs at the bottom of a ring at theta = 0."""
    return {"mass": 0.28, "motor": MOTOR,
            "rail": {"shape": "circle", "radius": radius, "center": center, "axes": [[0, 0, -1], across]}}


task = ballast.Scenario({
    "name": "desk", "duration": 6.0, "gravity": 9.81, "ball": BALL, "surface": {"static_friction": 0.5},
    "task": {"goal": [0.2, 0.0], "duration": 6.0},
    "mass": [ring(0.0945, [0, -0.06, 0], [1, 0, 0]), ring(0.0945, [0, 0.06, 0], [1, 0, 0]), ring(0.0495, [0, 0, 0.03], [0, 1, 0])],
})
plan = ballast.plan(task, "desk_plan.toml")
print(f"{plan.status}: needs f_s/N = {plan.claims['mu_required']['max']:.4f}; limited by {plan.binding}")
for tracking in (False, True):
    scenario = plan.scenario.set("run.actuation", "ideal").set("control.tracking", tracking)
    scenario.set("ball.mass", 0.9 * BALL["mass"]).set("believed.ball.mass", BALL["mass"])
    run = ballast.run(scenario)
    print(f"tracking {tracking}: {run.end_reason}, {1e3 * run.summary['tracking']['rms']:.1f} mm rms from the plan")
