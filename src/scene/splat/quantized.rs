//! Conversions shared by the compact formats, which store colours, opacities and standard deviations instead of SH
//! coefficients, logits and logarithms.

use crate::gaussians::SH_C0;

/// The constant SH coefficient for a colour channel value from 0 to 1.
pub(in crate::scene) fn sh_dc_of_color(color: f32) -> f32 {
    (color - 0.5) / SH_C0
}

/// The logit of an opacity given as a byte. 0 and 255 are moved half a step inwards, so that the logit is finite.
pub(in crate::scene) fn opacity_logit_of_byte(byte: u8) -> f32 {
    let opacity = f32::from(byte).clamp(0.5, 254.5) / 255.0;
    (opacity / (1.0 - opacity)).ln()
}

/// Stands for the logarithm of a standard deviation of zero, which some exporters write: e^-20 is negligible in any
/// scene.
const SMALLEST_LOG_SCALE: f32 = -20.0;

/// The logarithm of a standard deviation; NaN if it is negative or NaN, since such a Gaussian cannot be drawn.
pub(in crate::scene) fn log_scale_of_deviation(deviation: f32) -> f32 {
    deviation.ln().clamp(SMALLEST_LOG_SCALE, f32::INFINITY)
}

/// A unit quaternion w x y z from the index of its largest component, which is positive, and the three others in order.
pub(in crate::scene) fn quaternion_of_smallest_three(largest: usize, others: [f32; 3]) -> [f32; 4] {
    let sum: f32 = others.iter().map(|v| v * v).sum();
    let mut rest = others.into_iter();
    std::array::from_fn(|i| if i == largest { (1.0 - sum).max(0.0).sqrt() } else { rest.next().unwrap_or(0.0) })
}

/// Decodes an IEEE 754 binary16.
pub(in crate::scene) fn half_float(bytes: [u8; 2]) -> f32 {
    let bits = u16::from_le_bytes(bytes);
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f32::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * (-24f32).exp2(),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + fraction) * ((exponent - 25) as f32).exp2(),
    }
}
