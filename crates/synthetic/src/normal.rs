use rand::Rng;
use std::f64::consts::TAU;

/// One sample of the standard normal distribution (Box and Muller 1958, one of the pair).
pub fn standard_normal(rng: &mut impl Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    let v: f64 = rng.random();
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::standard_normal;
    use rand::{SeedableRng, rngs::StdRng};

    #[test]
    fn first_moments_are_right() {
        let mut rng = StdRng::seed_from_u64(3);
        let samples: Vec<f64> = (0..40_000).map(|_| standard_normal(&mut rng)).collect();
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let var = samples.iter().map(|x| x * x).sum::<f64>() / n;
        let kurtosis = samples.iter().map(|x| x.powi(4)).sum::<f64>() / n;
        assert!(mean.abs() < 0.02 && (var - 1.0).abs() < 0.03 && (kurtosis - 3.0).abs() < 0.2);
    }
}
