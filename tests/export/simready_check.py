"""Validates USD assets against SimReady's profile Robotics-Prop; prints of each the profile's version and, for each feature,
whether it passed, whether it failed although it is required, and the requirements that it failed, as JSON."""

import contextlib
import json
import sys

import simready.validate


def check(path):
    config = simready.validate.AssetValidationConfig(asset_path=path, profile_id="Robotics-Prop")
    result = simready.validate.validate_asset(config)
    features = {
        name: {"passed": found["passed"], "blocking": found.get("blocking_failure", not found["passed"]),
               "failing": found.get("failing requirements", "")}
        for name, found in result.features_summary.items()
    }
    return {"version": result.profile_version, "features": features}


with contextlib.redirect_stdout(sys.stderr):
    simready.validate.initialize(rules_and_requirements_paths=[], features_paths=[], profiles_paths=[])
    checked = [check(path) for path in sys.argv[1:]]
print(json.dumps(checked, default=str))
simready.validate.destroy()
