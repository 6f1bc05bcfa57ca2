//! Runs contestants in turns, round after round, so that other load on the machine affects all of them alike.

use serde::Serialize;
use std::time::Instant;

/// A contestant: its work, and the times that the work took.
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
    /// Wall time.
    pub wall_s: Vec<f64>,
    /// Processor time of all threads of the pool, which is the better measure on a busy machine. 0 where the system
    /// does not report it.
    pub cpu_s: Vec<f64>,
}

impl Times {
    pub fn wall(&self) -> f64 {
        median(&self.wall_s)
    }

    /// Median processor time, or wall time where the system does not report processor time.
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

    fn turn(&mut self, pool: &rayon::ThreadPool) {
        let (cpu, start) = (cpu_seconds(pool), Instant::now());
        self.result = pool.install(|| (self.work)());
        self.times.wall_s.push(start.elapsed().as_secs_f64());
        self.times.cpu_s.push(cpu_seconds(pool) - cpu);
    }
}

/// Runs each contestant once in every round, after one round that is not counted. With 0 rounds, that one is counted.
pub fn rounds(contestants: &mut [Contestant<'_>], rounds: usize, pool: &rayon::ThreadPool) {
    for round in 0..=rounds {
        for contestant in contestants.iter_mut() {
            contestant.turn(pool);
            if round == 0 && rounds > 0 {
                contestant.times = Times::default();
            }
        }
    }
}

/// Processor time of the pool's threads so far. The time of the whole process would not do: Embree's own threads keep
/// looking for work after a build, and would be charged to the contestant whose turn it is.
fn cpu_seconds(pool: &rayon::ThreadPool) -> f64 {
    let own = |_: rayon::BroadcastContext<'_>| -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    pool.broadcast(own).into_iter().flatten().sum::<f64>() * 1e-9
}
