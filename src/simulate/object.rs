//! The object in motion: the particles that deform, on the grid, and the rigid bodies.

use nalgebra::Vector3;

use super::rigid::body::{Body, Moments, State, Velocities};
use super::rigid::contact::Ground;
use super::rigid::coupling::{self, Guest, Joints, Meeting, Moving};
use super::rigid::face::Face;
use crate::mpm::boundary::Boundary;
use crate::mpm::in_order::InOrder;
use crate::mpm::laws::Law;
use crate::mpm::particles::{Motion, Particle};
use crate::mpm::{DRIFT, Lost, Setting, Solver, is_within};

/// How the particles of an object belong together.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bodies {
    /// Per particle: the number of its rigid body; `None` if it deforms.
    pub body_of: Vec<Option<u32>>,
    /// Per particle: its part.
    pub part_of: Vec<u32>,
    /// Per particle: whether it may touch the ground, as part of a rigid body; strays of the cloud may not.
    pub is_solid: Vec<bool>,
    /// Per part: E / (1 - nu^2), Pa.
    pub plane_modulus_pa: Vec<f64>,
}

/// Where a particle is.
#[derive(Debug, Clone, Copy)]
enum Place {
    /// Its number in the solver.
    Grid(u32),
    Body {
        body: u32,
        member: u32,
    },
}

/// The object in motion.
pub struct Object {
    solver: Solver,
    /// Per particle of the solver: its number in the object.
    on_grid: Vec<u32>,
    places: Vec<Place>,
    bodies: Vec<Body>,
    guests: Vec<Guest>,
    /// How far a particle of a body may have moved since the guests were chosen.
    wandered_m: f64,
    /// The ground as the bodies meet it.
    grounds: Vec<Ground>,
    gravity_m_s2: Vector3<f64>,
    spacing_m: f32,
    domain_m: [[f32; 3]; 2],
}

/// The influences on an object during a substep, besides gravity and the ground.
pub trait Influence: Sync {
    /// Whether there are forces at all.
    fn has_forces(&self) -> bool;
    /// The velocity of a deforming particle after the forces on it.
    fn on_particle(&self, id: u32, velocity_m_s: [f32; 3]) -> [f32; 3];
    /// Impulse and angular impulse of the forces on a body.
    fn on_body(&self, number: usize, body: &Body) -> coupling::Impulse;
    /// Whether there are given motions at all.
    fn has_leads(&self) -> bool;
    /// The motion given to a deforming particle at a position.
    fn leads(&self, id: u32, position_m: [f32; 3]) -> Option<Motion>;
    /// The velocities given to a body with this centre of mass.
    fn leads_body(&self, number: usize, center_m: Vector3<f64>) -> Option<Velocities>;
}

impl Object {
    /// An object of `particles`, in the order of their numbers, with `bodies` that meet the `ground`.
    pub fn new(mut setting: Setting, particles: Vec<Particle>, bodies: &Bodies, ground: Option<&Boundary>) -> Self {
        let count = bodies.body_of.iter().flatten().max().map_or(0, |last| *last as usize + 1);
        let mut members: Vec<Vec<(u32, Particle)>> = vec![vec![]; count];
        let (mut on_grid, mut own, mut places) = (vec![], vec![], Vec::with_capacity(particles.len()));
        for (id, particle) in (0..).zip(particles) {
            match bodies.body_of.get(id as usize).copied().flatten() {
                Some(body) => {
                    let member = members[body as usize].len() as u32;
                    members[body as usize].push((id, particle));
                    places.push(Place::Body { body, member });
                }
                None => {
                    places.push(Place::Grid(on_grid.len() as u32));
                    on_grid.push(id);
                    own.push(particle);
                }
            }
        }
        setting.laws.push(Law::Rigid);
        let (spacing_m, domain_m) = (setting.spacing_m, setting.domain_m);
        let gravity_m_s2 = Vector3::from(setting.gravity_m_s2.map(f64::from));
        let is_coupled = !own.is_empty() || count > 1;
        let spread_m2 = if is_coupled { coupling::spread_m2(spacing_m.into()) } else { 0.0 };
        let least_area_m2 = (f64::from(spacing_m) / 2.0).powi(2);
        let body = |members: Vec<(u32, Particle)>| {
            let faces = faces(&members, bodies, least_area_m2);
            Body::new(members, faces, spread_m2)
        };
        let mut object = Self {
            solver: Solver::new(setting, own),
            on_grid,
            places,
            bodies: members.into_iter().map(body).collect(),
            guests: vec![],
            wandered_m: 0.0,
            grounds: ground.into_iter().map(Ground::from).collect(),
            gravity_m_s2,
            spacing_m,
            domain_m,
        };
        object.renew();
        object
    }

    /// Resets it to what [`Object::new`] would make of its present state.
    pub fn renew(&mut self) {
        if self.is_coupled() {
            self.invite();
        }
    }

    fn is_coupled(&self) -> bool {
        !self.on_grid.is_empty() || self.bodies.len() > 1
    }

    /// Chooses the guests anew.
    fn invite(&mut self) {
        self.guests = coupling::guests(&self.solver, &self.bodies, self.spacing_m);
        let law = self.solver.laws() - 1;
        let guest = |guest: &Guest| {
            let body = &self.bodies[guest.body as usize];
            Particle { law: law as u32, mass_kg: 0.0, ..body.particle(guest.of(&self.bodies)) }
        };
        self.solver.host(self.guests.iter().map(guest).collect());
        self.wandered_m = 0.0;
    }

    /// The largest component of any deforming particle's velocity, or a bound on the speed of the rigid bodies' particles,
    /// whichever is larger, m/s.
    pub fn fastest_m_s(&self) -> f64 {
        let bodies = self.bodies.iter().map(Body::fastest_m_s);
        bodies.fold(if self.is_coupled() { self.solver.fastest_m_s().into() } else { 0.0 }, f64::max)
    }

    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Lets it fall freely for `dt_s`, along the parabola of each of its particles: as long as they all move alike,
    /// nothing strains.
    pub fn fall(&mut self, dt_s: f64) {
        self.solver.fall(dt_s as f32);
        for body in &mut self.bodies {
            body.shift((body.state().velocity_m_s + self.gravity_m_s2 * (dt_s / 2.0)) * dt_s);
            body.push(self.gravity_m_s2 * (dt_s * body.mass_kg()), Vector3::zeros());
        }
        self.renew();
    }

    /// Takes a substep of `dt_s`.
    ///
    /// # Errors
    /// If a particle is lost.
    pub fn step(&mut self, dt_s: f64, influence: &impl Influence) -> Result<(), Lost> {
        let velocities: Vec<Velocities> = self.bodies.iter().map(Body::velocities).collect();
        if influence.has_forces() {
            let ids = &self.on_grid;
            self.solver.change_velocities(|own, v| match ids.get(own as usize) {
                Some(id) => influence.on_particle(*id, v),
                None => v,
            });
            for (number, body) in self.bodies.iter_mut().enumerate() {
                let [push, turn] = influence.on_body(number, body);
                body.push(push, turn);
            }
        }
        let lead = |(number, body): (usize, &Body)| influence.leads_body(number, body.state().center_m);
        let led: Vec<Option<Velocities>> = self.bodies.iter().enumerate().map(lead).collect();
        for (body, led) in self.bodies.iter_mut().zip(&led) {
            if let Some([velocity_m_s, spin]) = *led {
                body.set_motion(velocity_m_s, spin);
            }
        }
        let start = StepStart { dt_s, velocities, led };
        if self.is_coupled() {
            self.step_on_grid(&start, influence)?;
        } else {
            let joints = Joints::none(&self.bodies);
            accelerate(&mut self.bodies, &self.grounds, self.gravity_m_s2, &start, &joints);
        }
        let mut fastest_m_s = 0.0_f64;
        for (body, led) in self.bodies.iter_mut().zip(&start.led) {
            fastest_m_s = fastest_m_s.max(body.fastest_m_s());
            match *led {
                Some(velocities) => body.lead(velocities, dt_s),
                None => {
                    body.advance(dt_s);
                    self.grounds.iter().for_each(|ground| ground.lift(body));
                }
            }
        }
        self.wandered_m += fastest_m_s * dt_s;
        self.bodies.iter().find_map(|body| self.lost(body)).map_or(Ok(()), Err)
    }

    /// Takes a substep on the grid; the bodies get their new velocities, but keep their places.
    fn step_on_grid(&mut self, start: &StepStart, influence: &impl Influence) -> Result<(), Lost> {
        let moving: Vec<Moving> = self.bodies.iter().map(Moving::from).collect();
        let (bodies, guests) = (&self.bodies, &self.guests);
        self.solver.place_guests(|guest| guests[guest].moved(bodies, &moving));
        // Guests are chosen with room for a drift of a cell; a little less, to allow for rounding.
        let far_m = 0.95 * f64::from(DRIFT) * f64::from(self.spacing_m);
        if self.solver.is_due_for_sorting() || self.wandered_m > far_m {
            self.invite();
        }
        let dt = start.dt_s as f32;
        let on_grid = &self.on_grid;
        let guided = |id: u32, position_m| influence.leads(*on_grid.get(id as usize)?, position_m);
        if influence.has_leads() {
            self.solver.take(guided);
        }
        self.solver.scatter(dt);
        let meeting = Meeting { bodies: &self.bodies, guests: &self.guests, moving: &moving };
        let is_led = |body: usize| start.led[body].is_some();
        let spacing_m = f64::from(self.spacing_m);
        let joints = coupling::join(&self.solver, meeting, is_led, self.gravity_m_s2, spacing_m, start.dt_s);
        accelerate(&mut self.bodies, &self.grounds, self.gravity_m_s2, start, &joints);
        joints.carry(&mut self.solver, &self.bodies);
        let gathered = self.solver.gather(dt);
        if influence.has_leads() {
            self.solver.lead(dt, guided);
        }
        gathered.map_err(|lost| Lost { particle: self.number_of(lost.particle) as usize, ..lost })
    }

    /// The number in the object of a particle of the solver.
    fn number_of(&self, id: usize) -> u32 {
        match self.on_grid.get(id) {
            Some(own) => *own,
            None => self.guests[id - self.on_grid.len()].of(&self.bodies).id,
        }
    }

    /// The first particle of a body, if the body has left the domain or its position is not finite.
    fn lost(&self, body: &Body) -> Option<Lost> {
        let (center, radius) = (body.state().center_m, body.radius_m());
        let [low, high] = self.domain_m.map(|corner| Vector3::from(corner.map(f64::from)));
        // False also if the centre is NaN.
        let is_inside = (0..3).all(|a| low[a] < center[a] - radius && center[a] + radius < high[a]);
        let member = body.members().first()?;
        let particle = body.particle(member);
        (!is_inside).then_some(Lost {
            particle: member.id as usize,
            position_m: particle.position_m,
            velocity_m_s: particle.velocity_m_s,
        })
    }

    /// All particles in the order in which they were given.
    pub fn particles(&self) -> Particles<'_> {
        Particles { grid: self.solver.particles(), object: self }
    }

    /// Moments of the masked particles of each body.
    pub fn moments(&self, mask: &[bool]) -> Vec<Moments> {
        self.bodies.iter().map(|body| body.moments(mask)).collect()
    }

    /// The state of its bodies: for each its motion, then the peak pressure on each of its faces.
    pub fn numbers(&self) -> Vec<f64> {
        let numbers_of = |body: &Body| {
            let peaks: Vec<f64> = body.faces().iter().map(|face| face.peak_pressure_pa).collect();
            body.state().to_numbers().into_iter().chain(peaks)
        };
        self.bodies.iter().flat_map(numbers_of).collect()
    }

    /// Gives its bodies a state from [`Self::numbers`]; false if the numbers do not fit these bodies, or take one of them out
    /// of the domain.
    #[must_use]
    pub fn restore(&mut self, mut numbers: &[f64]) -> bool {
        for body in &mut self.bodies {
            let Some((state, rest)) = numbers.split_first_chunk::<{ State::NUMBERS }>() else { return false };
            body.set_state(State::from_numbers(state));
            let Some((peaks, rest)) = rest.split_at_checked(body.faces().len()) else { return false };
            for (face, peak) in body.faces_mut().iter_mut().zip(peaks) {
                face.peak_pressure_pa = *peak;
            }
            numbers = rest;
        }
        let is_placed = |body: &Body| {
            body.members().iter().all(|member| is_within(self.domain_m, body.particle(member).position_m))
        };
        if !numbers.is_empty() || !self.bodies.iter().all(is_placed) {
            return false;
        }
        self.renew();
        true
    }
}

/// The bodies at the start of a step.
struct StepStart {
    dt_s: f64,
    /// By body.
    velocities: Vec<Velocities>,
    /// By body: the velocities with which it is led through the step; `None` if it moves freely.
    led: Vec<Option<Velocities>>,
}

/// Changes the velocities of the bodies that move freely: by gravity, the impulses at their `joints`, and the grounds.
fn accelerate(bodies: &mut [Body], grounds: &[Ground], gravity_m_s2: Vector3<f64>, start: &StepStart, joints: &Joints) {
    let free = bodies.iter_mut().enumerate().filter(|(number, _)| start.led[*number].is_none());
    for (number, body) in free {
        let ([push, turn], response) = (joints.impulses[number], &joints.responses[number]);
        let (before, now) = (start.velocities[number], body.velocities());
        let loads = [now[0] - before[0], now[1] - before[1]];
        body.push(gravity_m_s2 * (start.dt_s * body.mass_kg()) + push, turn);
        grounds.iter().for_each(|ground| ground.act(body, response, &gravity_m_s2, &loads, start.dt_s));
    }
}

/// The faces of a body, part by part.
fn faces(members: &[(u32, Particle)], bodies: &Bodies, least_area_m2: f64) -> Vec<Face> {
    let part_of = |id: u32| bodies.part_of[id as usize];
    let mut parts: Vec<u32> = members.iter().map(|(id, _)| part_of(*id)).collect();
    parts.sort_unstable();
    parts.dedup();
    let face = |part: u32| {
        let own = members.iter().filter(|(id, _)| part_of(*id) == part && bodies.is_solid[*id as usize]);
        let points: Vec<Vector3<f64>> = own.map(|(_, p)| Vector3::from(p.position_m.map(f64::from))).collect();
        Face::new(part, &points, bodies.plane_modulus_pa[part as usize], least_area_m2)
    };
    parts.into_iter().map(face).collect()
}

/// All particles of an object in the order in which they were given.
pub struct Particles<'a> {
    grid: InOrder<'a>,
    object: &'a Object,
}

impl Particles<'_> {
    pub fn count(&self) -> usize {
        self.object.places.len()
    }

    pub fn get(&self, id: usize) -> Particle {
        match self.object.places[id] {
            Place::Grid(own) => self.grid.get(own as usize),
            Place::Body { body, member } => {
                let body = &self.object.bodies[body as usize];
                body.particle(&body.members()[member as usize])
            }
        }
    }

    /// Elastic energy of a particle, J.
    pub fn elastic_j(&self, id: usize) -> f64 {
        match self.object.places[id] {
            Place::Grid(own) => self.grid.elastic_j(own as usize),
            Place::Body { .. } => 0.0,
        }
    }

    /// Kinetic energy of everything, J.
    pub fn kinetic_j(&self) -> f64 {
        let own = self.object.on_grid.iter().enumerate().map(|(own, _)| {
            let p = self.grid.get(own);
            0.5 * f64::from(p.mass_kg) * Vector3::from(p.velocity_m_s.map(f64::from)).norm_squared()
        });
        own.sum::<f64>() + self.object.bodies.iter().map(Body::kinetic_j).sum::<f64>()
    }

    /// Those that deform.
    pub fn deforming(&self) -> impl ExactSizeIterator<Item = Particle> + '_ {
        (0..self.object.on_grid.len()).map(|own| self.grid.get(own))
    }

    pub fn iter(&self) -> impl Iterator<Item = Particle> + '_ {
        (0..self.count()).map(|id| self.get(id))
    }

    /// The state of the rigid bodies: see [`Object::numbers`].
    pub fn body_numbers(&self) -> Vec<f64> {
        self.object.numbers()
    }
}
