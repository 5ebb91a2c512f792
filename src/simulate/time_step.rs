//! The length of a substep.
//!
//! An explicit step must not outrun the fastest wave: dt <= C dx / (c_p + |v|), with c_p = sqrt((lambda + 2 mu) / rho)
//! of the material with the fastest waves (Courant, Friedrichs, Lewy 1928). The rest of a frame is divided into equal
//! steps that satisfy the bound; this is done again after every step because the speed changes.

/// The bound on the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepBound {
    /// C: share of the time in which a wave crosses a cell.
    pub cfl: f64,
    pub spacing_m: f64,
    /// c_p of the material with the fastest waves.
    pub wave_speed_m_s: f64,
    /// A step to take regardless of the bound.
    pub fixed_s: Option<f64>,
}

impl StepBound {
    /// The longest step if the fastest particle moves at `speed_m_s`.
    pub fn longest_s(&self, speed_m_s: f64) -> f64 {
        self.cfl * self.spacing_m / (self.wave_speed_m_s + speed_m_s)
    }

    /// The next step if `left_s` remain until the next frame: an equal share of them.
    pub fn next_s(&self, left_s: f64, speed_m_s: f64) -> f64 {
        if let Some(fixed_s) = self.fixed_s {
            return fixed_s.min(left_s);
        }
        left_s / (left_s / self.longest_s(speed_m_s)).ceil().max(1.0)
    }
}
