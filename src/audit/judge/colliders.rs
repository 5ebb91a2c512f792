//! Colliders: that they are where the seen shapes are, and about as large.

use super::super::hull::{Hull, extremes};
use super::{Finding, Kind, Subject, words};
use crate::scene::mesh::containers::Role;

pub fn judge(subject: &Subject) -> Option<Finding> {
    let has = |role: Role| subject.body.shapes.iter().any(|shape| shape.role == role);
    if !(has(Role::Visual) && has(Role::Collision)) {
        return None;
    }
    let (seen, colliding) = (subject.size.seen.as_ref()?, subject.size.colliding.as_ref()?);
    let (seen_hull, colliding_hull) = (Hull::of(&extremes(&seen.corners))?, Hull::of(&extremes(&colliding.corners))?);
    let size = seen.longest_side_m();
    let colliders_stand_out = seen_hull.farthest_beyond(&colliding_hull.corners);
    let seen_stands_out = colliding_hull.farthest_beyond(&seen_hull.corners);
    let volumes = seen.volume_m3.zip(colliding.volume_m3).filter(|_| seen.are_closed && colliding.are_closed);
    let ratio = volumes.map(|([_, seen, _], [_, colliding, _])| colliding / seen);
    let most = subject.args.collider_volume;
    let mut problems = Vec::new();
    for (distance, what) in [
        (colliders_stand_out, "the colliders stand out from what is seen"),
        (seen_stands_out, "what is seen stands out from the colliders"),
    ] {
        if distance > subject.args.collider_distance * size {
            let share = 100.0 * distance / size;
            problems.push(format!("{what} by {} ({} % of its size)", words::length(distance), words::list([share])));
        }
    }
    if let Some(ratio) = ratio.filter(|ratio| !(1.0 / most..=most).contains(ratio)) {
        let than = if ratio > 1.0 { "times the volume of what is seen" } else { "times less volume than what is seen" };
        problems.push(format!("the colliders have {} {than}", words::factor(ratio)));
    }
    let shape = subject.body.shapes.iter().find(|shape| shape.role == Role::Collision)?;
    let remedy = "make them from the seen mesh (a convex decomposition), or mend scale and origin";
    (!problems.is_empty()).then(|| subject.finding(Kind::Collider, &shape.place, problems.join("; "), remedy))
}
