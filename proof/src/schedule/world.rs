//! What lies outside a scheduler: how long things take, and what the hardware says. Numbers of a seed, each by what it is for and how often it was asked
//! for, so that a scheduler and the model that ask for the same things get the same answers.

use std::collections::BTreeMap;

use super::plan::{Plan, Time};
use crate::random::Random;

/// What takes time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Delay {
    /// Reading the driver's inputs.
    Inputs,
    /// Writing the outputs.
    Outputs,
    /// A run of the init function.
    Init,
    /// A run of the startup function.
    Startup,
    /// A run of an instance.
    Run(usize),
    /// From the time of a wake to the round.
    Wake,
}

/// The world of one run of a plan.
#[derive(Debug, Clone)]
pub struct World {
    seed: u64,
    delays_ns: Vec<u64>,
    asked: BTreeMap<Delay, u64>,
    driver_reads: u64,
}

impl World {
    /// The world of a plan, at its beginning.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let delays_ns = if plan.time == Time::Virtual { Vec::new() } else { plan.delays_ns.clone() };
        World { seed: plan.seed, delays_ns, asked: BTreeMap::new(), driver_reads: 0 }
    }

    /// How long something takes this time, in nanoseconds.
    pub fn delay_ns(&mut self, what: Delay) -> u64 {
        let count = self.asked.entry(what).or_default();
        *count += 1;
        let kind = match what {
            Delay::Inputs => 1,
            Delay::Outputs => 2,
            Delay::Init => 3,
            Delay::Startup => 4,
            Delay::Wake => 5,
            Delay::Run(instance) => 6 + instance as u64,
        };
        let mut random = Random::new(self.seed ^ (kind << 40) ^ (*count << 8));
        // Mostly next to nothing, so that not every cycle is late.
        let small = random.chance(if what == Delay::Wake { 80 } else { 60 });
        if small {
            random.one_of([0, 0, 1, 1000]).min(self.most())
        } else {
            *random.pick(&self.delays_ns).unwrap_or(&0)
        }
    }

    fn most(&self) -> u64 {
        self.delays_ns.iter().copied().max().unwrap_or(0)
    }

    /// What the driver puts into byte 1 of %I when it is read this time.
    pub fn driver_byte(&mut self) -> u8 {
        self.driver_reads += 1;
        // Bits stay for a few reads: an edge is something that was not there before.
        let random =
            |bit: u64, period: u64| Random::new(self.seed ^ (bit << 48) ^ (self.driver_reads / period)).chance(50);
        (0..8).fold(0, |byte, bit| byte | u8::from(random(bit, 1 + bit)) << bit)
    }
}
