"""Reading results in Python: of small work folders made here, and of the run of the hammer that scripts/test-wheel makes."""

import doctest
import hashlib
import json
import os
import shutil
import tempfile
import tracemalloc
import unittest
from pathlib import Path
from unittest import mock

import gprop
import numpy as np
from gprop._results import _version as version

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
        self.stages = [{"name": "vote", "digest": "v", "inputs": []}]
        self.stages += [{"name": "parts", "digest": "p", "inputs": [["vote", "v"]]}]
        self.write_bytes("field.ply", header.encode() + values.tobytes())
        label = {key: estimate(1.0) for key in ("density_kg_m3", "youngs_modulus_pa", "poisson_ratio")}
        label |= {key: estimate(1.0) for key in ("yield_strength_pa", "friction_rubber")}
        labels = [label | {"id": 2, "caption": "a cup", "material": "stoneware", "family": "ceramic"}]
        labels += [label | {"id": 4, "caption": "its lid", "material": "cork", "family": "wood"}]
        self.write("labels.json", labels)
        cup = {"id": 2, "volume_m3": estimate(1e-4), "thickness_m": None, "mass_kg": estimate(0.25)}
        cup |= {"center_of_mass_m": [1, 2, 3], "inertia_kg_m2": np.eye(3).tolist()}
        lid = {"id": 4, "volume_m3": None, "thickness_m": None, "mass_kg": None}
        lid |= {"center_of_mass_m": None, "inertia_kg_m2": None}
        whole = {"volume_m3": estimate(1e-4), "mass_kg": estimate(0.25), "center_of_mass_m": [1, 2, 3], "inertia_kg_m2": np.eye(3).tolist()}
        self.write("parts.json", {"object": whole, "parts": [cup, lid]})

    def write_run(self):
        """Writes run.json, with the checksums of the files that are there."""
        for stage in self.stages:
            files = {"vote": ["field.ply", "labels.json", "figure.png"], "parts": ["parts.json"], "grasp": ["grasp.json"]}[stage["name"]]
            there = [name for name in files if (self.folder / name).is_file()]
            stage["outputs"] = [{"path": name} | self.checksum(name) for name in there]
        record = {"version": version() or "0.1.0", "stages": self.stages}
        (self.folder / "run.json").write_text(json.dumps(record))

    def checksum(self, name):
        content = (self.folder / name).read_bytes()
        return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}

    def write(self, name, value):
        self.write_bytes(name, json.dumps(value).encode())

    def write_bytes(self, name, content):
        (self.folder / name).write_bytes(content)
        self.write_run()

    def assert_refused(self, words):
        with self.assertRaisesRegex(ValueError, words):
            gprop.load(self.folder)

    def test_parts_and_masses(self):
        cup = gprop.load(self.folder)
        np.testing.assert_array_equal(cup.mass_kg, [0.125, 0.25, 0.5])
        np.testing.assert_array_equal(cup.masses_kg, [[0.125, 0.25, 0.5], [np.nan] * 3])
        np.testing.assert_array_equal(cup.parts["center_of_mass_m"], [[1, 2, 3], [np.nan] * 3])
        self.assertEqual(cup.parts["inertia_kg_m2"].shape, (2, 3, 3))
        self.assertEqual(cup.parts["gaussians"].tolist(), [1, 2])
        self.assertEqual(cup.parts["caption"].tolist(), ["a cup", "its lid"])

    def test_the_whole_object(self):
        cup = gprop.load(self.folder)
        np.testing.assert_array_equal(cup.volume_m3, [5e-5, 1e-4, 2e-4])
        np.testing.assert_array_equal(cup.center_of_mass_m, [1, 2, 3])
        np.testing.assert_array_equal(cup.inertia_kg_m2, np.eye(3))

    def test_it_is_shown_in_five_lines(self):
        labels = json.loads((self.folder / "labels.json").read_text())
        labels[1]["caption"] = "its\x1b[2J\nlid" + 200 * "!"
        self.write("labels.json", labels)
        lines = repr(gprop.load(self.folder)).split("\n")
        self.assertEqual(len(lines), 5, lines)
        self.assertIn("2 parts, 3 Gaussians", lines[0])
        self.assertIn("mass 0.25 kg (0.125 to 0.5); volume 0.1 l", lines[1])
        self.assertIn("(1, 2, 3) m; inertia (1, 1, 1) kg m2", lines[2])
        self.assertTrue(lines[3].startswith("a cup 0.25 kg"), lines[3])
        self.assertIn("its\\x1b[2J\\nlid", lines[3])
        self.assertTrue(all(len(line) <= 120 for line in lines[1:]))

    def test_a_notebook_shows_the_figure_and_a_table(self):
        labels = json.loads((self.folder / "labels.json").read_text())
        labels[1]["caption"] = "<script>"
        self.write("labels.json", labels)
        self.assertNotIn("<img", gprop.load(self.folder)._repr_html_())
        self.write_bytes("figure.png", b"a picture")
        shown = gprop.load(self.folder)._repr_html_()
        for part in ("data:image/png;base64,YSBwaWN0dXJl", "0.25 kg (0.125 to 0.5)", "stoneware", "&lt;script&gt;", "unknown"):
            self.assertIn(part, shown)
        self.write_bytes("figure.png", b"another")
        (self.folder / "figure.png").write_bytes(b"one more")
        self.assert_refused("figure.png' has changed")

    def test_a_plot_has_every_part(self):
        try:
            import matplotlib
        except ImportError:
            if os.environ.get("GPROP_NO_SKIP"):
                raise
            self.skipTest("matplotlib is not installed")
        matplotlib.use("agg")
        axes = gprop.load(self.folder).plot()
        self.assertEqual([text.get_text() for text in axes.get_legend().get_texts()], ["a cup", "its lid"])
        self.assertEqual([len(cloud.get_offsets()) for cloud in axes.collections], [1, 2])

    def test_a_mesh_needs_its_scene(self):
        with self.assertRaisesRegex(ValueError, "is not in its scene"):
            gprop.load(shutil.copytree(self.folder, self.folder.parent / "copied")).mesh()

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
        place |= {"contacts_m": [[0, 0, 0], [0, 0, 1]], "approach": [1, 0, 0], "width_m": 1, "lever_m": 0.1, "offset_m": 0}
        place |= {"touched_share": 1, "bend_rad": 0}
        place |= {"position_m": [0, 0, 0.5], "quaternion_wxyz": [1, 0, 0, 0]}
        place |= {"force_n": 4, "f_hold_n": 2, "f_min_n": 2, "f_max_n": 9, "f_star_n": 5, "torque_margin_n_m": -0.5}
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

    def test_a_run_returns_what_its_work_folder_holds(self):
        program = self.folder.parent / "program"
        program.write_text(f"#!/bin/sh\necho '{json.dumps([['cup', str(self.folder)]])}'\n")
        program.chmod(0o755)
        with mock.patch("gprop._running._path", lambda: str(program)):
            self.assertEqual(gprop.run("scene").part("lid")["id"], 4)
            (name, cup), = gprop.run_all("scene").items()
        self.assertEqual((name, cup.part("lid")["id"]), ("cup", 4))

    def test_what_is_no_work_folder_is_refused(self):
        with self.assertRaisesRegex(FileNotFoundError, "did you mean"):
            gprop.load(self.folder.parent)
        with self.assertRaisesRegex(FileNotFoundError, "field.ply"):
            gprop.load(self.folder / "nowhere")
        objects = self.folder / "nowhere" / "objects"
        for name in ("object_1", "object_2", "not_run"):
            (objects / name).mkdir(parents=True)
        for name in ("object_1", "object_2"):
            (objects / name / "field.ply").write_bytes(b"")
        with self.assertRaisesRegex(FileNotFoundError, "did you mean .*object_1' or .*object_2'\\?"):
            gprop.load(objects.parent)
        (self.folder / "run.json").unlink()
        with self.assertRaisesRegex(FileNotFoundError, "run.json"):
            gprop.load(self.folder)

    def test_damaged_files_are_refused(self):
        whole, labels = (self.folder / "field.ply").read_bytes(), (self.folder / "labels.json").read_bytes()
        headers = (b"vertex many\n", b"vertex\n", b"vertex " + b"9" * 5000 + b"\n")
        damaged_fields = [whole[:-1], whole + b"0", b"ply\n", whole.replace(b"little", b"big"), b""]
        damaged_fields += [whole.replace(b"vertex 3\n", header) for header in headers]
        damaged_fields += [whole.replace(b"float y", b"float x"), whole.replace(b"part_label", b"part_ label")]
        damaged_fields += [b"ply\n" + b"comment c\n" * 200_000 + whole[4:]]
        for damaged in damaged_fields:
            self.write_bytes("field.ply", damaged)
            self.assert_refused("field.ply")
        for label in (3, -1, 2.5, np.nan):
            self.write_bytes("field.ply", whole[:-60] + np.array([0, 0, 0, label, 0] * 3, dtype="<f4").tobytes())
            self.assert_refused("does not list")
        self.write_bytes("field.ply", whole)
        self.write_bytes("labels.json", b"[")
        self.assert_refused("labels.json")
        cup, lid = json.loads(labels)
        # The second has a label less than field.ply, the third a number that no 64 bits hold.
        damaged_labels = [{}, [cup], [cup, lid | {"id": 10**30}], [{}], [3], [lid, cup], [cup, lid | {"id": 4.0}], [cup | {"id": 0}, lid], [cup, cup, lid]]
        damaged_labels += [[cup, lid | {"caption": caption}] for caption in (3, None, "\ud800")]
        damaged_labels += [[cup, lid | {"density_kg_m3": value}] for value in ("1", [True] * 3, {"low": 1}, [1, [2, 3]])]
        for damaged in damaged_labels:
            self.write("labels.json", damaged)
            self.assert_refused("gprop' is damaged")
        self.write_bytes("labels.json", labels)
        for damaged in ([1], {"object": None}, {"object": 3, "parts": []}):
            self.write("parts.json", damaged)
            self.assert_refused("gprop' is damaged")
        for damaged in ({}, [], {"stages": [{"name": "vote"}]}, {"version": "0.1.0", "stages": 3}):
            (self.folder / "run.json").write_text(json.dumps(damaged))
            self.assert_refused("run.json")

    def test_json_that_the_program_refuses_is_refused(self):
        deep = "labels.json' is damaged: it is nested more than 127 deep"
        damaged = [(b"[" * depth + b"]" * depth, deep) for depth in (128, 2000, 100_000)]
        damaged += [(b"[" * 100_000, deep), (b'{"a":' * 200 + b"1" + b"}" * 200, deep)]
        damaged += [(b"[NaN]", "out of range"), (b"[-Infinity]", "out of range"), (b"[1e999]", "out of range")]
        damaged += [(b'[{"id": 0, "id": 1}]', "a key twice"), (b"\xff", "labels.json"), (b"\xef\xbb\xbf[]", "labels.json")]
        for content, words in damaged:
            self.write_bytes("labels.json", content)
            self.assert_refused(words)
        self.write_bytes("labels.json", b"[" * 127 + b"]" * 127)
        self.assert_refused("gprop' is damaged")

    def test_files_that_are_no_regular_files_are_refused_at_once(self):
        for name in ("field.ply", "labels.json", "parts.json", "run.json"):
            path = self.folder / name
            content = path.read_bytes()
            path.unlink()
            os.mkfifo(path)
            self.assert_refused(f"{name}': it is a named pipe, not a regular file")
            path.unlink()
            path.symlink_to("/dev/zero")
            self.assert_refused(f"{name}': it is a device, not a regular file")
            path.unlink()
            path.write_bytes(content)
        gprop.load(self.folder)

    def test_files_that_changed_since_are_refused(self):
        for name in ("field.ply", "labels.json", "parts.json"):
            content = (self.folder / name).read_bytes()
            for changed in (content[:-1] + b" ", content + b" ", content[:-1]):
                (self.folder / name).write_bytes(changed)
                self.assert_refused(f"{name}' has changed since gprop wrote it")
            # A terabyte of nothing, which is not read.
            os.truncate(self.folder / name, 1 << 40)
            self.assert_refused(f"{name}' has changed since gprop wrote it")
            (self.folder / name).unlink()
            with self.assertRaises((ValueError, FileNotFoundError)):
                gprop.load(self.folder)
            (self.folder / name).write_bytes(content)
        record = json.loads((self.folder / "run.json").read_text())
        if version():
            (self.folder / "run.json").write_text(json.dumps(record | {"version": "0.0.1"}))
            self.assert_refused("made by gprop '0.0.1'")

    def test_one_long_caption_takes_its_own_memory_only(self):
        (label, _), words = json.loads((self.folder / "labels.json").read_text()), "a cup " * 170_000
        self.write("labels.json", [label | {"id": id, "caption": words if id == 8 else "a cup"} for id in range(1, 1501)])
        self.write("parts.json", {"object": None, "parts": []})
        tracemalloc.start()
        self.addCleanup(tracemalloc.stop)
        found = gprop.load(self.folder).parts["caption"]
        self.assertEqual((len(found), found[7]), (1500, words))
        # The caption has a megabyte; as a column of NumPy's strings, it would take 1500 times four.
        self.assertLess(tracemalloc.get_traced_memory()[1], 64e6)


@unittest.skipUnless(PLACE or os.environ.get("GPROP_NO_SKIP"), "GPROP_PLACE names no folder with hammer/gprop")
class Page(unittest.TestCase):
    def test_the_page_shows_what_it_says(self):
        self.addCleanup(os.chdir, os.getcwd())
        self.assertTrue(PLACE, "GPROP_NO_SKIP is set")
        os.chdir(PLACE)
        options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        outcome = doctest.testfile(str(PAGE), module_relative=False, optionflags=options)
        self.assertGreater(outcome.attempted, 10)
        self.assertEqual(outcome.failed, 0)


if __name__ == "__main__":
    unittest.main()
