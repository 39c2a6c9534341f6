//! `[fleet]`: many vehicles in one daemon.

use inekf_shared::topic::Instance;

use super::section::Section;

/// Vehicles in one daemon, at most.
const MAX_VEHICLES: usize = 4096;

/// The vehicles of one daemon; each is an instance of its own, with topics of its own.
///
/// ```
/// use inekf_service::config::Fleet;
///
/// // One vehicle, which the command line names, on one thread.
/// assert_eq!(Fleet::default(), Fleet { instances: vec![], threads: 1 });
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fleet {
    /// Their names; none if the command line names the one there is.
    pub instances: Vec<Instance>,
    /// Threads that they are dealt onto while they spin.
    pub threads: usize,
}

impl Fleet {
    pub(super) fn read(fleet: &mut Section<'_, '_>) -> Self {
        let text = fleet.optional_text("instances", "names and patterns, separated by commas");
        let instances = text.map_or(Ok(Vec::new()), |text| expand(&text));
        Self {
            instances: instances.unwrap_or_else(|problem| {
                fleet.contradict("instances", &problem);
                Vec::new()
            }),
            threads: fleet.integer("threads", None, 1..=256, 1),
        }
    }
}

impl Default for Fleet {
    fn default() -> Self {
        Section::defaults(Self::read)
    }
}

/// The instances that a text like `lead,car-{0..99}` names, in its order.
///
/// # Errors
/// A sentence that says what is wrong with it.
///
/// ```
/// use inekf_service::config::expand;
///
/// let names: Vec<String> = expand("lead,car-{8..10}")?.iter().map(|name| name.to_string()).collect();
/// assert_eq!(names, ["lead", "car-8", "car-9", "car-10"]);
/// // No instance twice.
/// assert!(expand("car-8,car-{8..10}").is_err());
/// # Ok::<(), String>(())
/// ```
pub fn expand(text: &str) -> Result<Vec<Instance>, String> {
    let mut instances: Vec<Instance> = Vec::new();
    for part in text.split(',') {
        for name in names(part.trim())? {
            let instance = Instance::new(&name).map_err(|error| error.to_string())?;
            instances.push(instance);
            if instances.len() > MAX_VEHICLES {
                return Err(format!("names more than {MAX_VEHICLES} vehicles"));
            }
        }
    }
    let mut sorted: Vec<&Instance> = instances.iter().collect();
    sorted.sort();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("names {:?} twice", pair[0].as_str())),
        None => Ok(instances),
    }
}

/// What a name stands for: itself, or with `{A..B}` in it one name for each number from A to B.
fn names(part: &str) -> Result<Vec<String>, String> {
    let Some((front, rest)) = part.split_once('{') else {
        return Ok(vec![part.to_owned()]);
    };
    let not_a_range =
        || format!("{part:?} is no pattern: write a range of numbers like car-{{0..99}}");
    let (range, back) = rest.split_once('}').ok_or_else(not_a_range)?;
    let (first, last) = range.split_once("..").ok_or_else(not_a_range)?;
    let number = |text: &str| text.parse::<u32>().map_err(|_| not_a_range());
    let (first, last) = (number(first)?, number(last)?);
    if first > last || (last - first) as usize >= MAX_VEHICLES {
        return Err(format!(
            "the range of {part:?} must go upwards, over at most {MAX_VEHICLES} numbers"
        ));
    }
    Ok((first..=last)
        .map(|number| format!("{front}{number}{back}"))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(text: &str) -> Vec<String> {
        let instances = expand(text).expect("it is good");
        instances.iter().map(Instance::to_string).collect()
    }

    #[test]
    fn names_and_ranges_come_in_their_order() {
        assert_eq!(expanded("car"), ["car"]);
        assert_eq!(expanded("b, a"), ["b", "a"]);
        assert_eq!(
            expanded("lead,car-{9..11}x"),
            ["lead", "car-9x", "car-10x", "car-11x"]
        );
        assert_eq!(expanded("n{0..4095}").len(), MAX_VEHICLES);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let bad = [
            ("", "is empty"),
            ("a,,b", "is empty"),
            ("a,b,a", "\"a\" twice"),
            ("c{1..2},c2", "\"c2\" twice"),
            ("c{1..}", "range of numbers"),
            ("c{1-2}", "range of numbers"),
            ("c{1..2", "range of numbers"),
            ("c{-1..2}", "range of numbers"),
            ("c{2..1}", "upwards"),
            ("c{0..4294967295}", "at most 4096"),
            ("n{0..4095},m", "more than 4096"),
            ("../{0..1}", "contains '.'"),
            ("c{0..1}{0..1}", "contains '{'"),
        ];
        for (text, words) in bad {
            let problem = expand(text).expect_err(text);
            assert!(problem.contains(words), "{text}: {problem}");
        }
    }
}
