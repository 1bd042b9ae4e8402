"""Runs the paper's ball with a heavier mass, and draws the friction it needs into friction.png."""
import ballast

scenario = ballast.Scenario("paper_ball").set("mass.1.mass", 1.2).set("duration", 2.0)
run = ballast.run(scenario)
contact = run.channels["contact"]
print(f"{run.end_reason} at t = {run.summary['end']['time']} s; holds: {run.holds}")
print(f"most f_s/N {run.summary['mu_required']['max']:.3f}, and {contact.mu_required.max():.3f} at the ticks")
print(f"least N at the ticks {contact.normal_force_n.min():.2f} N")
run.plot("friction_required").savefig("friction.png")
