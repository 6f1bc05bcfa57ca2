//! Contestants take turns, round after round, so that what else the machine does meets all of them.

use serde::Serialize;
use std::time::Instant;

/// One contestant: what it does, and what it took.
pub struct Contestant<'a> {
    pub name: String,
    work: Box<dyn FnMut() -> u64 + Send + 'a>,
    /// What the work returned, the same each time.
    pub result: u64,
    pub times: Times,
}

/// Seconds of each round.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Times {
    /// On the clock.
    pub wall_s: Vec<f64>,
    /// Of all processors together; on a busy machine the better measure. 0 where the system does not tell.
    pub cpu_s: Vec<f64>,
}

impl Times {
    pub fn wall(&self) -> f64 {
        median(&self.wall_s)
    }

    /// Processor time, or wall time where there is none.
    pub fn cost(&self) -> f64 {
        let cpu = median(&self.cpu_s);
        if cpu > 0.0 { cpu } else { self.wall() }
    }
}

pub fn median(samples: &[f64]) -> f64 {
    curitiba::pipeline::executor::median(samples)
}

impl<'a> Contestant<'a> {
    pub fn new(name: impl Into<String>, work: impl FnMut() -> u64 + Send + 'a) -> Self {
        Self { name: name.into(), work: Box::new(work), result: 0, times: Times::default() }
    }

    fn turn(&mut self) {
        let (cpu, start) = (cpu_seconds(), Instant::now());
        self.result = (self.work)();
        self.times.wall_s.push(start.elapsed().as_secs_f64());
        self.times.cpu_s.push(cpu_seconds() - cpu);
    }
}

/// Runs each contestant once a round on a pool of so many threads, after one round that is not counted.
pub fn rounds(contestants: &mut [Contestant<'_>], rounds: usize, pool: &rayon::ThreadPool) {
    for round in 0..=rounds {
        for contestant in contestants.iter_mut() {
            pool.install(|| contestant.turn());
            if round == 0 && rounds > 0 {
                contestant.times = Times::default();
            }
        }
    }
}

/// Processor time of all threads of this process so far.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let of_thread = |path: std::path::PathBuf| -> Option<f64> {
        let text = std::fs::read_to_string(path.join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    threads.filter_map(|entry| of_thread(entry.ok()?.path())).sum::<f64>() * 1e-9
}
