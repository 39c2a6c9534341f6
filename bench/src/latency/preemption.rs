//! How often others took a processor from the two sides: the kernel's count of involuntary context
//! switches. Each may make one round slow, and several where rounds are fewer than they.

use std::fs;

/// Those of all threads of this process and of its partner, if that is a process, until now.
pub fn count(partner: Option<u32>) -> u64 {
    let of_partner = partner.map_or(0, |id| of_process(&id.to_string()));
    of_process("self") + of_partner
}

/// Zero where the system does not say.
fn of_process(process: &str) -> u64 {
    let Ok(threads) = fs::read_dir(format!("/proc/{process}/task")) else {
        return 0;
    };
    let statuses = threads
        .filter_map(Result::ok)
        .filter_map(|thread| fs::read_to_string(thread.path().join("status")).ok());
    statuses.filter_map(|status| of_thread(&status)).sum()
}

fn of_thread(status: &str) -> Option<u64> {
    let mut lines = status.lines();
    let count = lines.find_map(|line| line.strip_prefix("nonvoluntary_ctxt_switches:"))?;
    count.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_involuntary_switches_are_taken_and_not_the_others() {
        let status = "Name:\tx\nvoluntary_ctxt_switches:\t7\nnonvoluntary_ctxt_switches:\t42\n";
        assert_eq!(of_thread(status), Some(42));
        assert_eq!(of_thread("voluntary_ctxt_switches:\t7\n"), None);
    }
}
