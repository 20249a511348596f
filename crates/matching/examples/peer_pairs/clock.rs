use std::hint::black_box;

/// Each piece of work is timed this often; the fastest counts.
pub const REPEATS: usize = 7;
/// Of work that takes longer than this fewer repeats are enough, microseconds.
const LONG_US: f64 = 2000.0;
/// Repeats of long work.
const LONG_REPEATS: usize = 3;

/// What the work gives, and the shortest CPU time of several runs of it, microseconds.
pub fn fastest<T>(mut work: impl FnMut() -> T) -> (T, f64) {
    let (mut result, mut best) = timed(&mut work);
    let repeats = if best > LONG_US { LONG_REPEATS } else { REPEATS };
    for _ in 1..repeats {
        let (again, spent) = timed(&mut work);
        best = best.min(spent);
        result = again;
    }
    (result, best)
}

fn timed<T>(work: &mut impl FnMut() -> T) -> (T, f64) {
    let began = cpu_us();
    let result = black_box(work());
    (result, cpu_us() - began)
}

/// CPU time of this process, all threads, microseconds: what other load on the machine hardly
/// disturbs, at the cost of a system call.
#[cfg(unix)]
fn cpu_us() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3
}

/// Wall time where there is no such clock.
#[cfg(not(unix))]
fn cpu_us() -> f64 {
    use std::{sync::OnceLock, time::Instant};
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1e6
}
