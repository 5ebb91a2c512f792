//! The peer's boundary conditions. Those on particles act on the ones that lie in their region at set-up, wherever they
//! move later; those on the grid act on the nodes in their region. A condition is active while start <= t < end, with t
//! the time at the start of the substep, in f32 as the peer compares them.

use nalgebra::Vector3;

use super::config::{Boundary, Surface};
use super::particle::Particle;

type Vec3 = Vector3<f32>;

/// Nodes at the grid's rim in which the bounding box stops material that would leave.
const PADDING: usize = 3;

/// End time of the bounding box.
const BOX_END: f32 = 999.0;

/// Number of substeps after its end during which a resetting cuboid still holds the grid.
const RESET_STEPS: f32 = 15.0;

/// Layers of a sequential release, whatever the configuration sets.
const LAYERS: usize = 50;

/// Extent of a `cut` collider's gap, and the share of the velocity kept in it.
const CUT_GAP: [f32; 2] = [0.4, 0.53];
const CUT_KEPT: f32 = 0.3;

/// start <= t < end, as the peer's kernels compare them: in f32.
#[derive(Debug, Clone, Copy)]
struct Span {
    start: f64,
    end: f64,
}

impl Span {
    fn holds(&self, t: f32) -> bool {
        t >= self.start as f32 && t < self.end as f32
    }

    /// Compares in f64, as the peer's Python does: near its start and end a cuboid can act without moving, or move
    /// without acting.
    fn moves(&self, t: f64) -> bool {
        t >= self.start && t < self.end
    }
}

/// A change to the velocities of the particles in `mask`, made before the transfer to the grid.
#[derive(Debug, Clone)]
pub struct OnParticles {
    span: Span,
    mask: Vec<bool>,
    action: Action,
}

#[derive(Debug, Clone, Copy)]
enum Action {
    /// Adds force / mass * dt.
    Push(Vec3),
    Set(Vec3),
    Turn(Turn),
}

/// Turns about the axis `normal` through `point`, left-handed, and moves along it.
#[derive(Debug, Clone, Copy)]
struct Turn {
    point: Vec3,
    normal: Vec3,
    /// Two unit vectors across the axis, at right angles to each other.
    across: [Vec3; 2],
    rate: f32,
    along: f32,
}

impl Turn {
    fn new(point: Vec3, normal: Vec3, rate: f32, along: f32) -> Self {
        let slanted = Vec3::new(1.0, 1.0, 1.0);
        let slanted = if slanted.dot(&normal).abs() < 0.01 { Vec3::new(0.72, 0.37, -0.67) } else { slanted };
        let first = slanted - normal * slanted.dot(&normal);
        let first = first * (1.0 / first.norm());
        Self { point, normal, across: [first, first.cross(&normal)], rate, along }
    }

    /// Computed from the angle about the axis, as in the peer, although the arc cosine is inaccurate at small angles.
    fn velocity(&self, position: &Vec3) -> Vec3 {
        let offset = position - self.point;
        let [first, second] = self.across;
        let distance = (offset - self.normal * offset.dot(&self.normal)).norm();
        let cosine = if distance > 0.0 { (offset.dot(&first) / distance).clamp(-1.0, 1.0) } else { -1.0 };
        let angle = cosine.acos();
        let (sine, cosine) = if offset.dot(&second) > 0.0 { angle } else { -angle }.sin_cos();
        first * (-distance * sine * self.rate) + second * (distance * cosine * self.rate) + self.normal * self.along
    }
}

impl OnParticles {
    /// Changes the velocities of its particles at time `t`.
    pub fn apply(&self, particles: &mut [Particle], t: f32, dt: f32) {
        if !self.span.holds(t) {
            return;
        }
        for (p, _) in particles.iter_mut().zip(&self.mask).filter(|(_, masked)| **masked) {
            p.velocity = match self.action {
                Action::Push(force) => p.velocity + force / p.mass * dt,
                Action::Set(velocity) => velocity,
                Action::Turn(turn) => turn.velocity(&p.position),
            };
        }
    }
}

/// A change to the velocities of the grid.
#[derive(Debug, Clone)]
pub enum OnGrid {
    /// Nothing leaves through the grid's rim.
    BoundingBox { cells: usize },
    /// A box that moves with the velocity it gives.
    Cuboid { span: CuboidSpan, point: Vec3, size: Vec3, velocity: Vec3 },
    /// Stops everything behind a plane; a cut leaves a gap.
    Plane { span: PlaneSpan, point: Vec3, normal: Vec3, cut: bool },
}

/// The times at which a cuboid acts.
#[derive(Debug, Clone, Copy)]
pub struct CuboidSpan {
    span: Span,
    /// Holds the whole grid before the cuboid starts and for some steps after its end.
    resets: bool,
}

/// The times at which a plane acts.
#[derive(Debug, Clone, Copy)]
pub struct PlaneSpan(Span);

impl OnGrid {
    /// The velocity of a node after the condition.
    pub fn apply(&self, node: [usize; 3], dx: f32, velocity: Vec3, t: f32, dt: f32) -> Vec3 {
        let place = Vector3::from(node.map(|i| i as f32 * dx));
        match self {
            Self::BoundingBox { cells } if t < BOX_END => {
                let mut kept = velocity;
                for a in 0..3 {
                    let leaves =
                        (node[a] < PADDING && velocity[a] < 0.0) || (node[a] >= cells - PADDING && velocity[a] > 0.0);
                    if leaves {
                        kept[a] = 0.0;
                    }
                }
                kept
            }
            Self::BoundingBox { .. } => velocity,
            Self::Cuboid { span, point, size, velocity: given } => {
                let offset = (place - point).abs();
                if span.span.holds(t) {
                    if (0..3).all(|a| offset[a] < size[a]) { *given } else { velocity }
                } else if span.resets && t < span.span.end as f32 + RESET_STEPS * dt {
                    Vec3::zeros()
                } else {
                    velocity
                }
            }
            Self::Plane { span, point, normal, cut } => {
                if !span.0.holds(t) || (place - point).dot(normal) >= 0.0 {
                    velocity
                } else if *cut && (CUT_GAP[0]..=CUT_GAP[1]).contains(&place.z) {
                    Vec3::new(velocity.x, 0.0, velocity.z) * CUT_KEPT
                } else {
                    Vec3::zeros()
                }
            }
        }
    }

    /// Moves the condition on after a substep that began at `t`.
    pub fn advance(&mut self, t: f64, dt: f64) {
        if let Self::Cuboid { span, point, velocity, .. } = self
            && span.span.moves(t)
        {
            for a in 0..3 {
                point[a] = (f64::from(point[a]) + dt * f64::from(velocity[a])) as f32;
            }
        }
    }
}

/// All conditions of a configuration, each kind in its order.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Impulses, which are applied first.
    pub impulses: Vec<OnParticles>,
    pub modifiers: Vec<OnParticles>,
    pub on_grid: Vec<OnGrid>,
}

impl Conditions {
    /// The conditions for `particles` at their positions at set-up, for steps of `dt` on a grid of `cells` cells each
    /// way.
    pub fn new(boundaries: &[Boundary], particles: &[Particle], dt: f64, cells: usize) -> Self {
        let mut all = Self::default();
        for boundary in boundaries {
            match *boundary {
                Boundary::BoundingBox {} => all.on_grid.push(OnGrid::BoundingBox { cells }),
                Boundary::Cuboid { point, size, velocity, start_time, end_time, reset } => {
                    let span = CuboidSpan { span: Span { start: start_time, end: end_time }, resets: reset == 1 };
                    let [point, size, velocity] = [point, size, velocity].map(Vector3::from);
                    all.on_grid.push(OnGrid::Cuboid { span, point, size, velocity });
                }
                Boundary::SurfaceCollider { point, normal, surface, start_time, end_time, .. } => {
                    // The peer computes slip, friction and separation, but then stops the node anyway.
                    let span = PlaneSpan(Span { start: start_time, end: end_time });
                    let (point, normal, cut) = (point.into(), unit(normal), surface == Surface::Cut);
                    all.on_grid.push(OnGrid::Plane { span, point, normal, cut });
                }
                Boundary::ParticleImpulse { force, num_dt, start_time, point, size } => {
                    all.impulses.push(OnParticles {
                        span: Span { start: start_time, end: start_time + dt * f64::from(num_dt) },
                        mask: in_box(particles, point.into(), size.into()),
                        action: Action::Push(force.into()),
                    });
                }
                Boundary::EnforceParticleTranslation { point, size, velocity, start_time, end_time } => {
                    all.modifiers.push(OnParticles {
                        span: Span { start: start_time, end: end_time },
                        mask: in_box(particles, point.into(), size.into()),
                        action: Action::Set(velocity.into()),
                    });
                }
                Boundary::EnforceParticleVelocityRotation {
                    point,
                    normal,
                    half_height_and_radius,
                    rotation_scale: rate,
                    translation_scale: along,
                    start_time,
                    end_time,
                } => {
                    let (point, normal) = (Vector3::from(point), unit(normal));
                    all.modifiers.push(OnParticles {
                        span: Span { start: start_time, end: end_time },
                        mask: in_cylinder(particles, point, normal, half_height_and_radius),
                        action: Action::Turn(Turn::new(point, normal, rate, along)),
                    });
                }
                Boundary::ReleaseParticlesSequentially {
                    normal,
                    start_position,
                    end_position,
                    start_time,
                    end_time,
                    ..
                } => {
                    let span = Span { start: start_time, end: end_time };
                    all.modifiers.extend(held_in_layers(particles, normal, [start_position, end_position], span));
                }
            }
        }
        all
    }
}

/// Per particle: whether it is nearer to `point` than `size` along each axis.
fn in_box(particles: &[Particle], point: Vec3, size: Vec3) -> Vec<bool> {
    let offsets = particles.iter().map(|p| (p.position - point).abs());
    offsets.map(|offset| (0..3).all(|a| offset[a] < size[a])).collect()
}

/// Per particle: whether it lies in the cylinder around `point` along `normal`.
fn in_cylinder(particles: &[Particle], point: Vec3, normal: Vec3, [half_height, radius]: [f32; 2]) -> Vec<bool> {
    let is_inside = |p: &Particle| {
        let offset = p.position - point;
        let height = offset.dot(&normal);
        height.abs() < half_height && (offset - normal * height).norm() < radius
    };
    particles.iter().map(is_inside).collect()
}

/// Holds the particles in boxes around the end position, each thinner than the one before, and releases one box after
/// the other.
fn held_in_layers(particles: &[Particle], normal: [f32; 3], [from, to]: [f64; 2], span: Span) -> Vec<OnParticles> {
    let axis = (0..3).rfind(|&a| normal[a] != 0.0).expect("checked by the configuration");
    let mut point = normal.map(|n| if n == 0.0 { 1.0 } else { 0.0 });
    let mut size = point;
    point[axis] = to as f32;
    let layer = f64::from((from - to).abs() as f32) / LAYERS as f64;
    let held = |i: usize| {
        size[axis] = (layer * (LAYERS - i) as f64) as f32;
        OnParticles {
            span: Span { end: span.end / LAYERS as f64 * (i + 1) as f64, ..span },
            mask: in_box(particles, point.into(), size.into()),
            action: Action::Set(Vec3::zeros()),
        }
    };
    (0..LAYERS).map(held).collect()
}

/// `normal` scaled to length one: the square root is in f32, the rest in f64, as in the peer.
fn unit(normal: [f32; 3]) -> Vec3 {
    let normal = normal.map(f64::from);
    let length = f64::from((normal.iter().map(|n| n * n).sum::<f64>() as f32).sqrt());
    Vector3::from(normal.map(|n| (1.0 / length * n) as f32))
}
