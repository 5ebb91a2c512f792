//! The places to grasp at, as SimReady's feature "grasp physics" requires: a line through each, from finger to finger.

use std::fmt::Write;

use super::text::{extent, list, quoted, triple, tuple};
use crate::export::Rigid;

/// Half the width with which a line is drawn, m.
const RADIUS: f64 = 0.001;

pub fn write(text: &mut String, rigid: &Rigid) {
    if rigid.grasps.is_empty() {
        return;
    }
    text.push_str("    def Scope \"grasps\"\n    {\n");
    for (n, grasp) in rigid.grasps.iter().enumerate() {
        let _ = write!(
            text,
            r#"        def BasisCurves "grasp_identifier_{number:02}" (
            doc = {doc}
        )
        {{
            float3[] extent = {extent}
            uniform token basis = "bezier"
            int[] curveVertexCounts = [2]
            point3f[] points = {points}
            uniform token purpose = "guide"
            uniform token type = "linear"
            float[] widths = [{diameter}, {diameter}] (
                interpolation = "vertex"
            )
            custom double gprop:force = {force}
            custom double gprop:forceMax = {f_max}
            custom double gprop:forceMin = {f_min}
            custom double gprop:forceStar = {f_star}
            custom quatd gprop:orientation = {orientation}
            custom point3d gprop:position = {position}
            custom double gprop:width = {width}
        }}
"#,
            number = n + 1,
            doc = quoted(&format!(
                "Press on the {} here. Press with gprop:force; forces are those of one finger in N. Position and orientation of a gripper whose z points at the \
                 object and whose y leads from finger to finger; width between the fingers in m",
                grasp.part
            )),
            // In 32 bits, as USD computes it.
            extent = extent(
                grasp
                    .contacts_m
                    .iter()
                    .flat_map(|c| [-RADIUS, RADIUS].map(|d| c.map(|x| f64::from(x as f32 + d as f32))))
            ),
            points = list(grasp.contacts_m.iter().map(|c| triple(*c))),
            diameter = 2.0 * RADIUS,
            force = grasp.force_n,
            f_max = grasp.f_max_n,
            f_min = grasp.f_min_n,
            f_star = grasp.f_star_n,
            orientation = tuple(grasp.quaternion_wxyz, 9),
            position = tuple(grasp.position_m, 9),
            width = grasp.width_m,
        );
    }
    text.push_str("    }\n");
}
