"""Sweeps a mass and the floor's friction, and draws where the paper's ball holds into sweep_map/map.png."""
import ballast

MASS, FLOOR = "mass.0.mass", "surface.static_friction"
done = ballast.sweep({
    "scenario": "paper_ball",
    "name": "sweep_map",
    "set": {"run.actuation": "prescribed", "duration": 8.0},
    "vary": {MASS: {"grid": [0.8, 0.9, 1.0, 1.1, 1.2]}, FLOOR: {"grid": [0.12, 0.15, 0.18, 0.21, 0.24]}},
}, "sweep_map", map_keys=(MASS, FLOOR))
print(done.page)
held, floor = done.columns["held"], done.columns[FLOOR]
for mass in sorted(set(done.columns[MASS])):
    holds = floor[held & (done.columns[MASS] == mass)]
    print(f"{MASS} = {mass}: holds from mu_s = {holds.min() if holds.size else 'none of these'}")
