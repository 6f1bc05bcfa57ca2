//! The load of the machine, which is printed before anything is timed.

use super::failure;
use curitiba::environment::Environment;

/// Prints the load average and the number of threads to the error stream, and warns if other programs are at work.
pub fn tell(environment: &Environment) {
    crate::tell!("{}", in_words(environment));
    if let Some(load) = environment.busy() {
        failure::print_warning(&format!("other programs are at work (load {load:.2}); times are longer and vary more"));
    }
}

fn in_words(environment: &Environment) -> String {
    let threads = match environment.threads {
        1 => "1 thread".to_owned(),
        threads => format!("{threads} threads"),
    };
    match environment.load_average {
        Some(load) => format!("load average {load:.2}, {threads}"),
        None => format!("load average not known, {threads}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_is_told_with_the_number_of_threads() {
        let with = |load_average, threads| Environment { load_average, threads, ..Environment::here() };
        assert_eq!(in_words(&with(Some(0.5), 2)), "load average 0.50, 2 threads");
        assert_eq!(in_words(&with(None, 1)), "load average not known, 1 thread");
    }
}
