//! Ports that attach anew after somebody removed their files.
//!
//! Shared memory that is mapped stays usable after its file was removed, and nothing fails: a feeder then sends, and a
//! reader listens, to nobody, for a daemon that opens its ports anew does so under new files. So when nothing goes or
//! comes, and then at most every quarter of a second, the files of the services are looked at: if one has gone, or is
//! another than it was, the ports are let go of and opened again, as often as it takes. As long as messages flow nothing
//! is looked at. The look is some system calls; opening takes as long as it did the first time.

use inekf_shared::clock::monotonic_ns;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Config, Node, TransportError, Watched};

/// Time between two looks, nanoseconds.
const PERIOD_NS: u64 = 250_000_000;
/// Where looks at the clock should lie apart, nanoseconds.
const APART_NS: u64 = PERIOD_NS / 8;
/// They are at most this many calls apart.
const MOST_APART: u64 = 64;

/// How a kind of ports is opened.
type Open<P> = fn(&Node, &Instance) -> Result<P, TransportError>;

/// Ports P of one instance, and the node that they were made on.
pub(crate) struct Attached<P> {
    /// None while they cannot be opened.
    ports: Option<Live<P>>,
    open: Open<P>,
    instance: Instance,
    name: &'static str,
    config: Config,
    looked_ns: u64,
    /// Whether something went or came since.
    heard: bool,
    /// How often they were opened anew.
    times: u64,
}

struct Live<P> {
    ports: P,
    watched: Watched,
    // After the ports, which were made on it.
    node: Node,
}

impl<P> Attached<P> {
    /// Opens the ports on `node`; `name` is that of the nodes that follow.
    pub(crate) fn open(
        node: Node,
        name: &'static str,
        instance: &Instance,
        open: Open<P>,
    ) -> Result<Self, TransportError> {
        let config = node.config().clone();
        Ok(Self {
            ports: Some(Live::open(node, instance, open)?),
            open,
            instance: instance.clone(),
            name,
            config,
            looked_ns: monotonic_ns(),
            heard: false,
            times: 0,
        })
    }

    /// The ports, unless they are being opened anew.
    pub(crate) fn ports(&mut self) -> Option<&mut P> {
        self.ports.as_mut().map(|live| &mut live.ports)
    }

    /// How often they were opened anew.
    pub(crate) fn times(&self) -> u64 {
        self.times
    }

    /// Notes that something goes or comes: all is well.
    pub(crate) fn heard(&mut self) {
        self.heard = true;
    }

    /// To be called when nothing goes or comes, `now_ns` being CLOCK_MONOTONIC: attaches anew if that is why.
    #[cold]
    pub(crate) fn look(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.looked_ns) < PERIOD_NS {
            return;
        }
        self.looked_ns = now_ns;
        if core::mem::take(&mut self.heard) {
            return;
        }
        match self.ports.take() {
            Some(live) if live.watched.is_intact() => {
                self.ports = Some(live);
                return;
            }
            Some(live) => live.let_go(),
            None => {}
        }
        // What does not work now is tried at the next look: whoever holds the old files may let go of them meanwhile.
        let opened = transport::open_node_with(self.name, &self.config)
            .and_then(|node| Live::open(node, &self.instance, self.open));
        self.ports = opened.ok();
        self.times += u64::from(self.ports.is_some());
        // Opening may have taken long.
        self.looked_ns = monotonic_ns();
    }
}

impl<P> Live<P> {
    fn open(node: Node, instance: &Instance, open: Open<P>) -> Result<Self, TransportError> {
        let ports = open(&node, instance)?;
        Ok(Self {
            watched: Watched::services_of(&node)?,
            ports,
            node,
        })
    }

    /// Lets go of the old ports, and of nothing that others have made in their place since.
    fn let_go(self) {
        let Self {
            ports,
            watched,
            node,
        } = self;
        watched.sparing_others(|| {
            drop(ports);
            drop(node);
        });
    }
}

/// Looks at the clock now and then only: about as often as a look at the files is due, however often it is asked.
#[derive(Debug)]
pub(crate) struct Seldom {
    /// Calls until the next look.
    left: u64,
    /// Calls between the last two.
    apart: u64,
    last_ns: u64,
}

impl Seldom {
    /// Asks the clock at the first call.
    pub(crate) const fn new() -> Self {
        Self {
            left: 1,
            apart: 1,
            last_ns: 0,
        }
    }

    /// CLOCK_MONOTONIC, nanoseconds, every so many calls.
    pub(crate) fn now_ns(&mut self) -> Option<u64> {
        self.asked(monotonic_ns)
    }

    fn asked(&mut self, clock: impl FnOnce() -> u64) -> Option<u64> {
        self.left -= 1;
        if self.left > 0 {
            return None;
        }
        let now_ns = clock();
        let took_ns = now_ns.saturating_sub(self.last_ns).max(1);
        self.apart = (self.apart * APART_NS / took_ns).clamp(1, MOST_APART);
        self.left = self.apart;
        self.last_ns = now_ns;
        Some(now_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_is_asked_seldom_by_who_calls_often_and_each_time_by_who_calls_seldom() {
        let mut seldom = Seldom::new();
        let mut now_ns = 1_000_000_000_000;
        let mut asked = |calls: u64, each_ns: u64| {
            let looks = (0..calls).filter(|_| {
                now_ns += each_ns;
                seldom.asked(|| now_ns).is_some()
            });
            looks.count() as u64
        };
        // Spinning: every 64th call.
        assert!((1560..1580).contains(&asked(100_000, 100)));
        // Once a second: after what was left of the 64 each call.
        asked(MOST_APART, 1_000_000_000);
        assert_eq!(asked(100, 1_000_000_000), 100);
        // A hundred times a second: every third.
        asked(10, 10_000_000);
        assert!((320..345).contains(&asked(1000, 10_000_000)));
    }
}
