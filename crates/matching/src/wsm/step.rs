use super::pairing::WeightedPair;
use crate::Prior;
use crate::fast::turn;
use geometry::{Matrix2, Pose2, Vector2, wrap_angle};

/// The matrix that turns by a right angle.
fn j() -> Matrix2<f64> {
    Matrix2::new(0.0, -1.0, 1.0, 0.0)
}

/// A Gaussian prior in reference-frame coordinates `(p, phi)`.
struct PriorTerm {
    pp: Matrix2<f64>,
    p_phi: Vector2<f64>,
    phi_phi: f64,
    mean: Pose2,
}

impl PriorTerm {
    fn new(prior: &Prior) -> Self {
        let turn = turn(&prior.pose);
        let h = turn * prior.information * turn.transpose();
        PriorTerm {
            pp: h.fixed_view::<2, 2>(0, 0).into_owned(),
            p_phi: Vector2::new(h[(0, 2)], h[(1, 2)]),
            phi_phi: h[(2, 2)],
            mean: prior.pose,
        }
    }

    /// Gradients of half the prior's cost with respect to `p` and `phi` at a pose.
    fn gradient(&self, p: Vector2<f64>, phi: f64) -> (Vector2<f64>, f64) {
        let (dp, dphi) = (p - self.mean.translation(), wrap_angle(phi - self.mean.yaw));
        (self.pp * dp + self.p_phi * dphi, self.p_phi.dot(&dp) + self.phi_phi * dphi)
    }
}

/// One round of the Weighted Scan Matcher's alternating minimisation with frozen pairs: translation
/// in closed form, centre of rotation, one Newton step of rotation about it. Returns the new pose,
/// or
/// `None` where the pairs leave a direction open.
///
/// The letters (a) to (d) are those of docs/math/wsm.md.
pub(crate) fn alternating_step(
    pairs: &[WeightedPair],
    pose: &Pose2,
    prior: &Prior,
) -> Option<Pose2> {
    let prior = PriorTerm::new(prior);
    let j = j();
    let (p, phi) = (pose.translation(), pose.yaw);
    // (a) translation
    let (mut total, mut pull) = (Matrix2::zeros(), Vector2::zeros());
    let mut turn = Vector2::zeros();
    for k in pairs {
        total += k.weight;
        pull += k.weight * (k.a - k.c);
        turn += k.weight * (j * (0.5 * (k.a + k.c)));
    }
    total += prior.pp;
    let total = total.try_inverse()?;
    let dp = total * (pull - prior.gradient(p, phi).0);
    // (b) the centre about which a rotation does not disturb the translation
    let m = j.transpose() * (total * (turn + prior.pp * (j * p) + prior.p_phi));
    // (c) rotation
    let (mut gradient, mut newton, mut gauss_newton) = (0.0, 0.0, 0.0);
    for k in pairs {
        let q = k.c + dp - m;
        let e = k.a - m - q;
        let (jq, we) = (j * q, k.weight * e);
        gradient += we.dot(&jq);
        gauss_newton += jq.dot(&(k.weight * jq));
        newton += we.dot(&q);
    }
    let arm = j * (p + dp - m);
    let (g_p, g_phi) = prior.gradient(p + dp, phi);
    gradient -= arm.dot(&g_p) + g_phi;
    gauss_newton += arm.dot(&(prior.pp * arm)) + 2.0 * arm.dot(&prior.p_phi) + prior.phi_phi;
    let curvature = if gauss_newton + newton > 0.5 * gauss_newton {
        gauss_newton + newton
    } else {
        gauss_newton
    };
    let dphi = gradient / curvature;
    // (d) update
    let moved = Pose2::new(0.0, 0.0, dphi).rotate(p + dp - m) + m;
    let next = Pose2::new(moved.x, moved.y, phi + dphi);
    (next.x.is_finite() && next.y.is_finite() && next.yaw.is_finite()).then_some(next)
}
