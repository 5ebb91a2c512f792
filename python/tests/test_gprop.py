"""The Python door: on small work folders made here, and on the run of the hammer that scripts/test-wheel makes."""

import doctest
import json
import os
import tempfile
import unittest
from pathlib import Path

import gprop
import numpy as np

#: Folder with the work folder `hammer/gprop`.
PLACE = os.environ.get("GPROP_PLACE")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


def estimate(mid):
    return {"low": 0.5 * mid, "mid": mid, "high": 2 * mid}


class Made(unittest.TestCase):
    """A work folder with three Gaussians and two parts, of which one has no volume."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name) / "gprop"
        self.folder.mkdir()
        names = ["x", "y", "z", "part_label", "E"]
        values = np.arange(15, dtype="<f4").reshape(3, 5)
        values[:, 3] = [4, 2, 4]
        header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
        header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
        (self.folder / "field.ply").write_bytes(header.encode() + values.tobytes())
        label = {key: estimate(1.0) for key in ("density_kg_m3", "youngs_modulus_pa", "poisson_ratio")}
        label |= {key: estimate(1.0) for key in ("yield_strength_pa", "friction_rubber")}
        labels = [label | {"id": 2, "caption": "a cup", "material": "stoneware", "family": "ceramic"}]
        labels += [label | {"id": 4, "caption": "its lid", "material": "cork", "family": "wood"}]
        self.write("labels.json", labels)
        cup = {"id": 2, "volume_m3": estimate(1e-4), "thickness_m": None, "mass_kg": estimate(0.25)}
        cup |= {"center_of_mass_m": [1, 2, 3], "inertia_kg_m2": np.eye(3).tolist()}
        lid = {"id": 4, "volume_m3": None, "thickness_m": None, "mass_kg": None}
        lid |= {"center_of_mass_m": None, "inertia_kg_m2": None}
        self.write("parts.json", {"object": {"mass_kg": estimate(0.25)}, "parts": [cup, lid]})
        self.stages = [{"name": "vote", "digest": "v", "inputs": []}]
        self.stages += [{"name": "parts", "digest": "p", "inputs": [["vote", "v"]]}]
        self.write_run()

    def write_run(self):
        self.write("run.json", {"stages": self.stages})

    def write(self, name, value):
        (self.folder / name).write_text(json.dumps(value))

    def test_parts_and_masses(self):
        cup = gprop.load(self.folder)
        np.testing.assert_array_equal(cup.mass_kg, [0.125, 0.25, 0.5])
        np.testing.assert_array_equal(cup.masses_kg, [[0.125, 0.25, 0.5], [np.nan] * 3])
        np.testing.assert_array_equal(cup.parts["center_of_mass_m"], [[1, 2, 3], [np.nan] * 3])
        self.assertEqual(cup.parts["inertia_kg_m2"].shape, (2, 3, 3))
        self.assertEqual(cup.parts["gaussians"].tolist(), [1, 2])
        self.assertEqual(cup.parts["caption"].tolist(), ["a cup", "its lid"])

    def test_bodies_that_are_written_as_parts_are_one_part(self):
        inertia = np.diag([0.001, 0.002, 0.003]).tolist()
        body = {"id": 4, "thickness_m": estimate(0.03), "volume_m3": estimate(1e-5), "inertia_kg_m2": inertia}
        light = body | {"mass_kg": estimate(0.11), "center_of_mass_m": [0.3, 0, 0]}
        heavy = body | {"mass_kg": estimate(0.33), "center_of_mass_m": [-0.1, 0, 0]}
        self.write("parts.json", {"object": None, "parts": [light, heavy]})
        lid = gprop.load(self.folder).part("lid")
        np.testing.assert_allclose(lid["mass_kg"], [0.22, 0.44, 0.88])
        np.testing.assert_allclose(lid["volume_m3"], [1e-5, 2e-5, 4e-5])
        np.testing.assert_allclose(lid["thickness_m"], [0.015, 0.03, 0.06])
        np.testing.assert_allclose(lid["center_of_mass_m"], 0, atol=1e-15)
        # 0.11 * 0.3^2 + 0.33 * 0.1^2 = 0.0132 kg m2 about y and z, besides the bodies' own.
        np.testing.assert_allclose(lid["inertia_kg_m2"], np.diag([0.002, 0.0172, 0.0192]), atol=1e-15)

    def test_results_that_no_longer_hold_are_left_out(self):
        self.write("grasp.json", {"f_star_n": 5, "candidates": []})
        self.assertIsNone(gprop.load(self.folder).grasp, "the grasp stage was not done")
        self.stages += [{"name": "grasp", "digest": "g", "inputs": [["vote", "v"], ["parts", "p"]]}]
        self.write_run()
        self.assertEqual(gprop.load(self.folder).grasp["f_star_n"], 5)
        self.stages[0]["digest"] = "another vote"
        self.write_run()
        cup = gprop.load(self.folder)
        self.assertIsNone(cup.grasp)
        self.assertTrue(np.isnan(cup.mass_kg).all() and np.isnan(cup.masses_kg).all())
        self.stages.clear()
        self.write_run()
        with self.assertRaisesRegex(FileNotFoundError, "vote"):
            gprop.load(self.folder)

    def test_field(self):
        cup = gprop.load(str(self.folder))
        np.testing.assert_array_equal(cup.positions, [[0, 1, 2], [5, 6, 7], [10, 11, 12]])
        np.testing.assert_array_equal(cup.field["E"], [4, 9, 14])

    def test_a_part_is_found_by_a_piece_of_its_name(self):
        cup = gprop.load(self.folder)
        self.assertEqual(cup.part("LID")["id"], 4)
        self.assertEqual(cup.part("stoneware")["id"], 2)
        for name, words in (("handle", "0 parts"), ("t", "2 parts")):
            with self.assertRaisesRegex(KeyError, words):
                cup.part(name)

    def test_without_grasps(self):
        cup = gprop.load(self.folder)
        self.assertIsNone(cup.grasp)
        self.assertEqual((len(cup.grasps), cup.grasps["contacts_m"].shape), (0, (0, 2, 3)))

    def test_with_a_grasp(self):
        place = {"part": "a cup", "part_id": 2, "feasible": True, "thickness_m": estimate(0.003)}
        place |= {"contacts_m": [[0, 0, 0], [0, 0, 1]], "approach": [1, 0, 0], "width_m": 1, "lever_m": 0.1}
        place |= {"position_m": [0, 0, 0.5], "quaternion_wxyz": [1, 0, 0, 0]}
        place |= {"f_min_n": 2, "f_max_n": 9, "f_star_n": 5, "torque_margin_n_m": -0.5}
        self.write("grasp.json", {"f_star_n": 5, "candidates": [place, place]})
        self.stages += [{"name": "grasp", "digest": "g", "inputs": [["parts", "p"]]}]
        self.write_run()
        cup = gprop.load(self.folder)
        self.assertEqual(cup.grasps["f_star_n"].tolist(), [5, 5])
        self.assertEqual(cup.grasps["feasible"].tolist(), [True, True])
        self.assertEqual(cup.grasp["f_star_n"], 5)

    def test_an_unknown_scale_leaves_nan(self):
        self.write("parts.json", {"scale": "unknown", "object": None, "parts": [], "shapes": []})
        cup = gprop.load(self.folder)
        self.assertTrue(np.isnan(cup.mass_kg).all() and np.isnan(cup.masses_kg).all())
        self.assertEqual(cup.parts["density_kg_m3"].tolist(), [[0.5, 1, 2]] * 2)

    def test_what_is_no_work_folder_is_refused(self):
        with self.assertRaisesRegex(FileNotFoundError, "did you mean"):
            gprop.load(self.folder.parent)
        with self.assertRaisesRegex(FileNotFoundError, "field.ply"):
            gprop.load(self.folder / "nowhere")
        (self.folder / "run.json").unlink()
        with self.assertRaisesRegex(FileNotFoundError, "run.json"):
            gprop.load(self.folder)

    def test_damaged_files_are_refused(self):
        whole, labels = (self.folder / "field.ply").read_bytes(), (self.folder / "labels.json").read_text()
        for damaged in (whole[:-1], whole + b"0", b"ply\n", whole.replace(b"little", b"big")):
            (self.folder / "field.ply").write_bytes(damaged)
            with self.assertRaisesRegex(ValueError, "field.ply"):
                gprop.load(self.folder)
        (self.folder / "field.ply").write_bytes(whole)
        for damaged in (b"vertex many\n", b"vertex\n"):
            (self.folder / "field.ply").write_bytes(whole.replace(b"vertex 3\n", damaged))
            with self.assertRaisesRegex(ValueError, "field.ply"):
                gprop.load(self.folder)
        (self.folder / "field.ply").write_bytes(whole)
        (self.folder / "labels.json").write_text("[")
        with self.assertRaisesRegex(ValueError, "labels.json"):
            gprop.load(self.folder)
        cup, lid = json.loads(labels)
        # The second has a label less than field.ply, the third a number that no 64 bits hold.
        for damaged in ({}, [cup], [cup, lid | {"id": 10**30}], [{}], [3]):
            self.write("labels.json", damaged)
            with self.assertRaisesRegex(ValueError, "gprop' is damaged"):
                gprop.load(self.folder)
        (self.folder / "labels.json").write_text(labels)
        for damaged in ([1], {"object": None}, {"object": 3, "parts": []}):
            self.write("parts.json", damaged)
            with self.assertRaisesRegex(ValueError, "gprop' is damaged"):
                gprop.load(self.folder)
        for damaged in ({}, [], {"stages": [{"name": "vote"}]}):
            self.write("run.json", damaged)
            with self.assertRaisesRegex(ValueError, "run.json"):
                gprop.load(self.folder)


@unittest.skipUnless(PLACE, "GPROP_PLACE names no folder with hammer/gprop")
class Page(unittest.TestCase):
    def test_the_page_shows_what_it_says(self):
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(PLACE)
        options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        outcome = doctest.testfile(str(PAGE), module_relative=False, optionflags=options)
        self.assertGreater(outcome.attempted, 10)
        self.assertEqual(outcome.failed, 0)


if __name__ == "__main__":
    unittest.main()
