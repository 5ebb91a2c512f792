"""Validates a USD asset against SimReady's profile Robotics-Prop; prints the profile's version and, for each feature, whether
it passed, whether it failed although it is required, and the requirements that it failed, as JSON."""

import contextlib
import json
import sys

import simready.validate

with contextlib.redirect_stdout(sys.stderr):
    simready.validate.initialize(rules_and_requirements_paths=[], features_paths=[], profiles_paths=[])
    config = simready.validate.AssetValidationConfig(asset_path=sys.argv[1], profile_id="Robotics-Prop")
    result = simready.validate.validate_asset(config)
features = {
    name: {"passed": found["passed"], "blocking": found.get("blocking_failure", not found["passed"]),
           "failing": found.get("failing requirements", "")}
    for name, found in result.features_summary.items()
}
print(json.dumps({"version": result.profile_version, "features": features}, default=str))
simready.validate.destroy()
