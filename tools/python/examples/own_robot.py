"""A robot of one's own, written as a dict: on which floors it rolls, and with which margin."""
import ballast

ROBOT = {
    "name": "mine",
    "duration": 4.0,
    "gravity": 9.81,
    "ball": {"radius": 0.15, "mass": 0.8, "inertia": [0.0118] * 3},
    "surface": {"static_friction": 0.5},
    "mass": [{
        "mass": 0.5,
        "rail": {"shape": "circle", "radius": 0.09, "axes": [[0, 0, -1], [1, 0, 0]]},
        "motion": [{"duration": 1.0, "acceleration": [0.0, 0.6]}, {"duration": 1.0, "acceleration": [0.6, 0.0]},
                   {"duration": 1.0, "acceleration": [0.0, -0.6]}, {"duration": 1.0, "acceleration": [-0.6, 0.0]}],
        "motor": {"preset": "nema17", "gear_ratio": 4.0, "viscous_damping": 0.02},
    }],
}

scenario = ballast.Scenario(ROBOT)
for warning in scenario.check():
    print("warning:", warning)
need = ballast.friction(scenario)
print(need["text"])
for actuation in ("prescribed", "stepper"):
    run = ballast.run(scenario, actuation=actuation)
    margin = 1 - run.summary["mu_required"]["max"] / ROBOT["surface"]["static_friction"]
    holds = [floor["name"] for floor in run.summary["surfaces"] if floor["holds"]]
    print(f"{actuation}: {run.end_reason}, margin {100 * margin:.0f} %, rolls on {', '.join(holds)}")
