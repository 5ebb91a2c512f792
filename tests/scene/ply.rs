//! PLY files built in code: every layout that 3DGS tools write, and everything that can be wrong with one.

use gprop::gaussians::{ExtraProperty, Gaussians};
use gprop::scene::splat::ply::{self, Loaded, Problem};
use proptest::prelude::*;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// One property of a file to be built: its name, its PLY type, one value per row.
#[derive(Debug, Clone)]
struct Property {
    name: String,
    scalar: &'static str,
    values: Vec<f32>,
}

/// The properties of a splat in the usual order, without normals; all values differ.
fn splat(count: usize, sh_degree: usize) -> Vec<Property> {
    let rest = [0, 9, 24, 45][sh_degree];
    let names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_owned).into_iter();
    let names = names.chain((0..rest).map(|i| format!("f_rest_{i}"))).chain(["opacity".to_owned()]);
    let names = names.chain((0..3).map(|i| format!("scale_{i}"))).chain((0..4).map(|i| format!("rot_{i}")));
    let value = |column: usize, row: usize| (column as f32 - 7.0) / 3.0 + row as f32 * 0.01;
    names
        .enumerate()
        .map(|(column, name)| Property {
            name,
            scalar: "float",
            values: (0..count).map(|row| value(column, row)).collect(),
        })
        .collect()
}

fn property(name: &str, scalar: &'static str, values: &[f32]) -> Property {
    Property { name: name.to_owned(), scalar, values: values.to_vec() }
}

fn encode(properties: &[Property], encoding: Encoding) -> Vec<u8> {
    let count = properties.first().map_or(0, |p| p.values.len());
    let format = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::Little => "binary_little_endian",
        Encoding::Big => "binary_big_endian",
    };
    let mut file = format!("ply\nformat {format} 1.0\ncomment made by a test\nelement vertex {count}\n").into_bytes();
    for Property { name, scalar, .. } in properties {
        file.extend(format!("property {scalar} {name}\n").bytes());
    }
    file.extend(b"end_header\n");
    for row in 0..count {
        for property in properties {
            file.extend(encode_value(property.values[row], property.scalar, encoding));
        }
        if encoding == Encoding::Ascii {
            file.push(b'\n');
        }
    }
    file
}

fn encode_value(value: f32, scalar: &str, encoding: Encoding) -> Vec<u8> {
    if encoding == Encoding::Ascii {
        // `{}` writes the shortest decimal that reads back as the same float32.
        return format!("{value} ").into_bytes();
    }
    let mut bytes = match scalar {
        "float" => value.to_le_bytes().to_vec(),
        "double" => f64::from(value).to_le_bytes().to_vec(),
        "uchar" => vec![value as u8],
        "short" => (value as i16).to_le_bytes().to_vec(),
        "int" => (value as i32).to_le_bytes().to_vec(),
        other => panic!("no test writes {other}"),
    };
    if encoding == Encoding::Big {
        bytes.reverse();
    }
    bytes
}

/// The smallest splat: one Gaussian, SH degree 0.
pub fn one_gaussian() -> Vec<u8> {
    encode(&splat(1, 0), Encoding::Little)
}

/// All values of `gaussians` under their PLY names, sorted by name.
fn by_name(gaussians: &Gaussians) -> Vec<(String, Vec<u32>)> {
    let mut columns = Vec::new();
    let mut add = |name: String, values: Vec<f32>| columns.push((name, values.into_iter().map(f32::to_bits).collect()));
    for (lane, name) in ["x", "y", "z"].into_iter().enumerate() {
        add(name.to_owned(), gaussians.positions.iter().map(|v| v[lane]).collect());
        add(format!("f_dc_{lane}"), gaussians.sh_dc.iter().map(|v| v[lane]).collect());
        add(format!("scale_{lane}"), gaussians.log_scales.iter().map(|v| v[lane]).collect());
    }
    for lane in 0..4 {
        add(format!("rot_{lane}"), gaussians.rotations.iter().map(|v| v[lane]).collect());
    }
    for lane in 0..3 * gaussians.sh_rest_per_channel() {
        add(format!("f_rest_{lane}"), (0..gaussians.len()).map(|i| gaussians.sh_rest_of(i)[lane]).collect());
    }
    add("opacity".to_owned(), gaussians.opacity_logits.clone());
    for extra in &gaussians.extra {
        add(extra.name.clone(), extra.values.clone());
    }
    columns.sort();
    columns
}

fn expected_by_name(properties: &[Property]) -> Vec<(String, Vec<u32>)> {
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect();
    let mut columns: Vec<_> = properties.iter().map(|p| (p.name.clone(), bits(&p.values))).collect();
    columns.sort();
    columns
}

fn refusal(file: &[u8]) -> Problem {
    ply::parse(file).expect_err("the file was accepted")
}

/// `file` with its header changed.
fn with_header(file: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    const END: &[u8] = b"end_header\n";
    let end = file.windows(END.len()).position(|w| w == END).unwrap() + END.len();
    let header = std::str::from_utf8(&file[..end]).unwrap();
    [change(header).as_bytes(), &file[end..]].concat()
}

proptest! {
    #![proptest_config(super::proptest_config())]

    #[test]
    fn any_layout_reads_as_the_same_values(
        encoding in prop::sample::select(vec![Encoding::Ascii, Encoding::Little, Encoding::Big]),
        degree in 0..4usize,
        count in 1..200usize,
        doubles in any::<u64>(),
        normals in any::<bool>(),
        order in any::<prop::sample::Index>(),
        shuffle in any::<u64>(),
    ) {
        let mut properties = splat(count, degree);
        if normals {
            properties.extend(["nx", "ny", "nz"].map(|name| property(name, "float", &vec![0.25; count])));
        }
        properties.push(property("red", "uchar", &vec![200.0; count]));
        properties.push(property("level", "short", &vec![-3.0; count]));
        for (index, property) in properties.iter_mut().enumerate().filter(|(_, p)| p.scalar == "float") {
            if doubles >> (index % 64) & 1 == 1 {
                property.scalar = "double";
            }
        }
        // A rotation and a deterministic shuffle: some files keep runs of neighbours together, some do not.
        let start = order.index(properties.len());
        properties.rotate_left(start);
        if shuffle % 2 == 0 {
            let mut state = shuffle;
            for i in (1..properties.len()).rev() {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                properties.swap(i, (state >> 33) as usize % (i + 1));
            }
        }
        let loaded = ply::parse(&encode(&properties, encoding)).unwrap();
        prop_assert_eq!(usize::from(loaded.gaussians.sh_degree), degree);
        prop_assert_eq!(by_name(&loaded.gaussians), expected_by_name(&properties));
    }

    #[test]
    fn what_is_written_reads_back_bit_for_bit(degree in 0..4usize, values in prop::collection::vec(-80.0..80.0f32, 300)) {
        let mut properties = splat(5, degree);
        for (index, property) in properties.iter_mut().enumerate() {
            property.values = (0..5).map(|row| values[index * 5 + row]).collect();
        }
        properties.push(property("nx", "float", &[f32::NAN, -0.0, 0.0, f32::MIN_POSITIVE / 2.0, 1.0]));
        let loaded = ply::parse(&encode(&properties, Encoding::Little)).unwrap();
        let mut written = Vec::new();
        ply::write(&mut written, &loaded.gaussians, &[]).unwrap();
        let again = ply::parse(&written).unwrap();
        prop_assert_eq!(by_name(&again.gaussians), expected_by_name(&properties));
    }

    #[test]
    fn damaged_bytes_never_panic(
        encoding in prop::sample::select(vec![Encoding::Ascii, Encoding::Little, Encoding::Big]),
        degree in 0..4usize,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 1..12),
        near_start in any::<bool>(),
    ) {
        let mut file = encode(&splat(3, degree), encoding);
        for (at, byte, edit) in edits {
            let reach = if near_start { file.len().min(150) } else { file.len() };
            let at = at.index(reach.max(1)).min(file.len().saturating_sub(1));
            match edit {
                _ if file.is_empty() => {}
                0 => file[at] = byte,
                1 => file.insert(at, byte),
                2 => drop(file.remove(at)),
                _ => file.truncate(at),
            }
        }
        let _ = ply::parse(&file);
    }

    #[test]
    fn scrambled_headers_never_panic(words in prop::collection::vec(header_words(), 0..40), tail in any::<[u8; 32]>()) {
        let mut file = b"ply\n".to_vec();
        file.extend(words.concat().bytes());
        file.extend(b"\nend_header\n");
        file.extend(tail);
        let _ = ply::parse(&file);
    }
}

fn header_words() -> impl Strategy<Value = String> {
    let known = [
        "format ascii 1.0\n",
        "format binary_little_endian 1.0\n",
        "format binary_big_endian 99999.0\n",
        "element ",
        "vertex ",
        "element vertex 2\n",
        "4294967296\n",
        "99999999999999999999999999\n",
        "property ",
        "property float x\n",
        "property list uchar int vertex_index\n",
        "list ",
        "double ",
        "f_rest_0",
        "\n",
        "\r\n",
        "\r",
        "comment ",
        "\t",
        " ",
        "obj_info",
        "end_header\n",
        "ply\n",
        "-1",
        "é",
        "0",
    ];
    prop_oneof![3 => prop::sample::select(known.to_vec()).prop_map(str::to_owned), 1 => ".{0,8}"]
}

#[test]
fn a_file_without_normals_and_one_with_are_written_as_they_came() {
    let without = encode(&splat(3, 1), Encoding::Little);
    let mut properties = splat(3, 1);
    for (index, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
        properties.insert(3 + index, property(name, "float", &[0.0, 1.0, -1.0]));
    }
    let with = encode(&properties, Encoding::Little);
    for file in [without, with] {
        let mut written = Vec::new();
        ply::write(&mut written, &ply::parse(&file).unwrap().gaussians, &[]).unwrap();
        let without_comment = with_header(&file, |header| header.replace("comment made by a test\n", ""));
        assert!(written == without_comment);
    }
}

#[test]
fn extra_properties_follow_the_rotation_and_replace_older_ones() {
    let mut properties = splat(2, 0);
    properties.insert(0, property("conf", "float", &[1.0, 2.0]));
    properties.insert(5, property("density", "float", &[3.0, 4.0]));
    let gaussians = ply::parse(&encode(&properties, Encoding::Little)).unwrap().gaussians;
    let extra = |name: &str, values: &[f32]| ExtraProperty { name: name.to_owned(), values: values.to_vec() };
    let mut written = Vec::new();
    ply::write(&mut written, &gaussians, &[extra("part_label", &[5.0, 6.0]), extra("density", &[7.0, 8.0])]).unwrap();
    let header = String::from_utf8_lossy(&written).into_owned();
    assert!(
        header.contains(
            "float rot_3\nproperty float part_label\nproperty float density\nproperty float conf\nend_header"
        )
    );
    let again = ply::parse(&written).unwrap().gaussians;
    assert_eq!(
        again.extra,
        [extra("part_label", &[5.0, 6.0]), extra("density", &[7.0, 8.0]), extra("conf", &[1.0, 2.0])]
    );
}

#[test]
fn what_does_not_fit_is_not_written() {
    let gaussians = ply::parse(&one_gaussian()).unwrap().gaussians;
    let extra = |name: &str, values: &[f32]| ExtraProperty { name: name.to_owned(), values: values.to_vec() };
    for bad in [extra("density", &[]), extra("two words", &[1.0]), extra("rot_0", &[1.0]), extra("", &[1.0])] {
        let mut written = Vec::new();
        assert!(ply::write(&mut written, &gaussians, std::slice::from_ref(&bad)).is_err(), "{bad:?}");
        assert!(written.is_empty());
    }
}

#[test]
fn gaussians_that_mean_nothing_are_dropped_and_counted() {
    let mut properties = splat(6, 1);
    let mut set = |name: &str, row: usize, value| {
        properties.iter_mut().find(|p| p.name == name).unwrap().values[row] = value;
    };
    set("y", 0, f32::NAN);
    set("f_rest_8", 2, f32::INFINITY);
    set("scale_1", 3, 1000.0);
    set("opacity", 4, f32::INFINITY);
    set("scale_0", 5, -200.0);
    for encoding in [Encoding::Ascii, Encoding::Little, Encoding::Big] {
        let Loaded { gaussians, warnings, .. } = ply::parse(&encode(&properties, encoding)).unwrap();
        assert_eq!(gaussians.len(), 3);
        assert_eq!(gaussians.sh_rest.len(), 27);
        assert_eq!(gaussians.opacity(1), 1.0, "an infinite logit is a plain 1");
        let x = &properties[0].values;
        assert_eq!(gaussians.positions.map_x(), [x[1], x[4], x[5]]);
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].starts_with("3 of 6 Gaussians"), "{warnings:?}");
    }
    for property in &mut properties {
        property.values.fill(f32::NAN);
    }
    assert!(matches!(refusal(&encode(&properties, Encoding::Big)), Problem::NothingFinite { count: 6 }));
}

trait MapX {
    fn map_x(&self) -> Vec<f32>;
}

impl MapX for Vec<[f32; 3]> {
    fn map_x(&self) -> Vec<f32> {
        self.iter().map(|position| position[0]).collect()
    }
}

#[test]
fn numbers_as_other_tools_spell_them() {
    let mut file = encode(&splat(1, 0), Encoding::Ascii);
    let body = file.len() - String::from_utf8_lossy(&file).lines().last().unwrap().len() - 1;
    file.truncate(body);
    file.extend(b"  1E-3 -.5 5. +2 1e3\t007 -inf -0.25 0 0 0 1.5e+1 0 0 0\r\n\n");
    let file = String::from_utf8(file).unwrap().replace("float f_dc_0", "int f_dc_0");
    // One value too many for the fourteen properties.
    assert!(matches!(refusal(file.as_bytes()), Problem::Row { line: 20, index: 0, .. }));
    let gaussians = ply::parse(file.replace(" 0 0 0\r", " 0 0\r").as_bytes()).unwrap().gaussians;
    assert_eq!(gaussians.positions, [[1e-3, -0.5, 5.0]]);
    assert_eq!(gaussians.sh_dc, [[2.0, 1000.0, 7.0]]);
    assert_eq!(gaussians.opacity_logits, [f32::NEG_INFINITY]);
}

#[test]
fn each_bad_file_has_its_message() {
    let good = encode(&splat(3, 1), Encoding::Little);
    let edited = |from: &str, to: &str| {
        with_header(&good, |header| {
            assert!(header.contains(from), "{from}");
            header.replacen(from, to, 1)
        })
    };
    let without = |names: &[&str]| {
        let kept: Vec<_> = splat(3, 1).into_iter().filter(|p| !names.contains(&p.name.as_str())).collect();
        encode(&kept, Encoding::Little)
    };
    let shape = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];
    let cases: [(&str, Vec<u8>, &[&str]); 20] = [
        ("empty", vec![], &["is not a PLY file"]),
        ("gzip", vec![0x1f, 0x8b, 8, 0, 0], &["is not a PLY file"]),
        ("no end", b"ply\nformat ascii 1.0\n".to_vec(), &["no `end_header`", "first 21 bytes"]),
        ("no format", edited("format binary_little_endian 1.0\n", ""), &["header is broken", "format"]),
        ("nonsense", edited("property float y", "property flaot y"), &["line 6", "property flaot y"]),
        ("huge number", edited("vertex 3", "vertex 99999999999999999999999"), &["line 4"]),
        ("no vertex", edited("element vertex", "element vortex"), &["no element `vertex`"]),
        ("none", edited("vertex 3", "vertex 0"), &["zero Gaussians"]),
        ("4e9", edited("vertex 3", "vertex 4000000000"), &["is truncated", "4000000000 Gaussians"]),
        ("all bits", edited("vertex 3", "vertex 9223372036854775807"), &["is truncated"]),
        ("twice", edited("property float y", "property float x"), &["declares property `x` twice (line 6)"]),
        (
            "element twice",
            edited("element vertex 3", "element vertex 3\nelement vertex 3"),
            &["element `vertex` twice"],
        ),
        ("list", edited("property float y", "property list uchar int y"), &["`y` is a list"]),
        (
            "list before",
            edited("element vertex", "element face 1\nproperty list uchar int i\nelement vertex"),
            &["`face`"],
        ),
        ("points", without(&shape), &["is a point cloud", "point_cloud/iteration_N"]),
        ("no scale", without(&["scale_1"]), &["vertex properties missing: scale_1"]),
        ("no colour", without(&["f_dc_0", "f_dc_2"]), &["missing: f_dc_0 f_dc_2"]),
        ("8 of 9", without(&["f_rest_8"]), &["has 8 properties f_rest_*", "0, 9, 24, 45"]),
        ("gap", without(&["f_rest_3"]), &["has 8 properties f_rest_*", "of which 3"]),
        (
            "compressed",
            edited("property float y", "property uint packed_position"),
            &["compressed splat without its element `chunk`"],
        ),
    ];
    for (name, file, needles) in cases {
        let message = refusal(&file).to_string();
        println!("{name}: {message}");
        for needle in needles {
            assert!(message.contains(needle), "{name}: `{needle}` is not in: {message}");
        }
    }
}

#[test]
fn values_that_were_written_activated_are_refused_at_once() {
    let mut cloud = crate::inspect::thinned().clone();
    assert!(ply::parse(&written(&cloud)).is_ok());
    let stored = cloud.clone();
    let words = |cloud: &Gaussians| refusal(&written(cloud)).to_string();
    cloud.log_scales.iter_mut().flatten().for_each(|scale| *scale = scale.exp());
    // Lengths alone: every Gaussian would be more than a scene unit large, which the whole object is not.
    assert!(words(&cloud).contains("all scales are positive; as logarithms"), "{}", words(&cloud));
    for i in 0..cloud.len() {
        cloud.opacity_logits[i] = stored.opacity(i) as f32;
    }
    let both = words(&cloud);
    assert!(
        both.contains("all scales are positive and all opacities lie within 0 and 1") && both.contains("ln(scale)")
    );
    cloud.log_scales.clone_from(&stored.log_scales);
    assert!(words(&cloud).contains("look activated: all opacities lie within 0 and 1"));
}

#[test]
fn a_coarse_cloud_in_small_units_is_no_activated_one() {
    let mut cloud = crate::inspect::thinned().clone();
    // In micrometres, every Gaussian is larger than one unit.
    for i in 0..cloud.len() {
        cloud.positions[i] = cloud.positions[i].map(|side| 1e6 * side);
        cloud.log_scales[i] = cloud.log_scales[i].map(|scale| (scale + 1e6_f32.ln()).max(0.1));
    }
    assert!(ply::parse(&written(&cloud)).is_ok());
}

fn written(cloud: &Gaussians) -> Vec<u8> {
    let mut file = Vec::new();
    ply::write(&mut file, cloud, &[]).unwrap();
    file
}

#[test]
fn a_truncated_file_says_what_it_needs_and_has() {
    for encoding in [Encoding::Little, Encoding::Big] {
        let good = encode(&splat(3, 0), encoding);
        let Problem::Truncated { count: 3, expected, found } = refusal(&good[..good.len() - 5]) else { panic!() };
        assert_eq!((expected, found), (good.len() as u128, good.len() as u64 - 5));
    }
    let text = String::from_utf8(encode(&splat(3, 0), Encoding::Ascii)).unwrap();
    let two_rows = text.trim_end().rsplit_once('\n').unwrap().0;
    assert!(matches!(refusal(two_rows.as_bytes()), Problem::TruncatedText { count: 3, found: 2 }));
    assert!(matches!(refusal(text.replace("vertex 3", "vertex 4000000").as_bytes()), Problem::Truncated { .. }));
    let half_row = &text.trim_end()[..text.len() - 12];
    assert!(refusal(half_row.as_bytes()).to_string().contains("14 values were expected"));
}

/// A splat of Apple's SHARP has seven more elements, with these types and numbers of rows.
#[test]
fn what_sharp_writes_beside_the_gaussians_is_one_note() {
    let good = encode(&splat(2, 0), Encoding::Little);
    let elements = [
        ("image_size", "uint", 2),
        ("intrinsic", "float", 9),
        ("extrinsic", "float", 16),
        ("frame", "int", 2),
        ("disparity", "float", 2),
        ("color_space", "uchar", 1),
        ("version", "uchar", 3),
    ];
    let declared: String =
        elements.map(|(name, kind, n)| format!("element {name} {n}\nproperty {kind} {name}\n")).concat();
    let bytes = 4 * (2 + 9 + 16 + 2 + 2) + 1 + 3;
    let sharp = with_header(&good, |header| header.replace("end_", &format!("{declared}end_")));
    let loaded = ply::parse(&[&sharp[..], &vec![0; bytes]].concat()).unwrap();
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_eq!(loaded.gaussians, ply::parse(&good).unwrap().gaussians);
    let [note] = &loaded.notes[..] else { panic!("{:?}", loaded.notes) };
    assert!(note.contains("SHARP") && elements.iter().all(|(name, ..)| note.contains(&format!("`{name}`"))), "{note}");
}

#[test]
fn what_is_left_out_is_said() {
    let good = encode(&splat(2, 0), Encoding::Little);
    let warnings = |file: &[u8]| ply::parse(file).unwrap().warnings;
    assert!(warnings(&[&good[..], b"tail"].concat())[0].starts_with("4 bytes after the last Gaussian"));
    let camera = with_header(&good, |header| header.replace("end_", "element camera 1\nproperty float fov\nend_"));
    assert_eq!(
        warnings(&[&camera[..], &[0; 4]].concat()),
        ["the file's element `camera` is not used, and field.ply does not have it"]
    );
    let mut properties = splat(2, 0);
    properties.push(property("id", "int", &[1.0, 2.0]));
    assert!(warnings(&encode(&properties, Encoding::Little))[0].contains("`id` is rounded to 32 bits"));
    // One situation makes one message.
    properties.push(property("time", "double", &[1.0, 2.0]));
    let rounded = warnings(&encode(&properties, Encoding::Little));
    assert_eq!(rounded, ["properties `id`, `time` are rounded to 32 bits, which no result depends on"]);
    let two = "element camera 0\nproperty float fov\nelement a 1\nproperty char a\nelement b 1\nproperty char b\nend_";
    let two = with_header(&good, |header| header.replace("end_", two));
    assert_eq!(
        warnings(&[&two[..], &[0; 2]].concat()),
        ["the file's elements `a`, `b` are not used, and field.ply does not have them"]
    );
    // An element of plain rows before the vertices is skipped.
    let before = with_header(&good, |header| {
        header.replace("element vertex", "element camera 1\nproperty float fov\nelement vertex")
    });
    let end = before.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let before = [&before[..end], &[9; 4], &before[end..]].concat();
    assert_eq!(ply::parse(&before).unwrap().gaussians, ply::parse(&good).unwrap().gaussians);
}

#[test]
fn flat_gaussians_get_a_thickness() {
    let mut properties = splat(2, 0);
    properties.retain(|property| property.name != "scale_2");
    let loaded = ply::parse(&encode(&properties, Encoding::Little)).unwrap();
    assert!(loaded.notes[0].starts_with("2DGS"), "{:?}", loaded.notes);
    let scales = loaded.gaussians.scale(0);
    assert!((scales.z / scales.x.min(scales.y) - 0.01).abs() < 1e-6, "{scales}");
}

#[test]
fn a_smoothing_filter_is_worked_in() {
    let mut properties = splat(2, 0);
    properties.push(property("filter_3D", "float", &[0.0, 0.5]));
    let plain = ply::parse(&encode(&splat(2, 0), Encoding::Little)).unwrap().gaussians;
    let loaded = ply::parse(&encode(&properties, Encoding::Little)).unwrap();
    assert!(loaded.gaussians.antialiased && loaded.notes[0].starts_with("Mip-Splatting"));
    let gaussians = loaded.gaussians;
    assert!(gaussians.extra.is_empty());
    // A filter of zero changes nothing.
    assert!((gaussians.scale(0) - plain.scale(0)).amax() < 1e-6);
    assert!((gaussians.opacity(0) - plain.opacity(0)).abs() < 1e-6);
    let (before, after) = (plain.scale(1), gaussians.scale(1));
    assert!((after.x - before.x.hypot(0.5)).abs() < 1e-5);
    let dimmed = plain.opacity(1) * before.product() / after.product();
    assert!((gaussians.opacity(1) - dimmed).abs() < 1e-6);
}

#[test]
fn a_smoothing_filter_that_is_no_number_costs_the_gaussian() {
    for encoding in [Encoding::Little, Encoding::Ascii] {
        let mut properties = splat(3, 0);
        properties.push(property("filter_3D", "float", &[0.0, f32::NAN, 0.5]));
        let loaded = ply::parse(&encode(&properties, encoding)).unwrap();
        assert_eq!(loaded.gaussians.len(), 2);
        assert!(loaded.warnings.iter().any(|warning| warning.contains('1')), "{:?}", loaded.warnings);
        *properties.last_mut().unwrap() = property("filter_3D", "float", &[f32::NAN; 3]);
        assert!(ply::parse(&encode(&properties, encoding)).is_err());
    }
}

#[test]
fn a_comment_tells_an_antialiased_splat() {
    let file = encode(&splat(1, 0), Encoding::Ascii);
    let with_comment = |comment: &str| with_header(&file, |header| header.replace("made by a test", comment));
    let marked = ply::parse(&with_comment("SplatRenderMode: mip")).unwrap().gaussians;
    assert!(marked.antialiased);
    let mut written = Vec::new();
    ply::write(&mut written, &marked, &[]).unwrap();
    assert_eq!(ply::parse(&written).unwrap().gaussians, marked);
    assert!(!ply::parse(&with_comment("SplatRenderMode: default")).unwrap().gaussians.antialiased);
    assert!(!ply::parse(&with_comment("a mip map")).unwrap().gaussians.antialiased);
}
