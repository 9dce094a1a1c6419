//! A diagnosis in words: one line for each finding, grouped by topic; the last line says whether to go on.

use super::diagnosis::{Diagnosis, Finding, Judgement, Topic};
use std::fmt;

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let records = {
            let mut all: Vec<&str> = self.findings.iter().map(|x| x.record.as_str()).collect();
            all.dedup();
            all
        };
        for record in &records {
            writeln!(f, "{} with record {record}", self.robot)?;
            let mut last: Option<Topic> = None;
            for x in self.findings.iter().filter(|x| x.record == *record) {
                let topic = if last == Some(x.topic) { "" } else { x.topic.name() };
                last = Some(x.topic);
                let channel = match &x.channel {
                    Some(c) if !x.text.starts_with(&format!("{c}:")) => format!("{c}: "),
                    _ => String::new(),
                };
                writeln!(f, "  {topic:<10} {:<10} {channel}{}", x.judgement.name(), x.text)?;
            }
            writeln!(f)?;
        }
        let count = |j: Judgement| self.findings.iter().filter(|x| x.judgement == j).count();
        let (wrong, suspicious) = (count(Judgement::Wrong), count(Judgement::Suspicious));
        // What is worst first; not every finding says what to do.
        let first = |j: Judgement| {
            let hint = |x: &Finding| x.problem.as_ref()?.hint.clone();
            let of = self.findings.iter().filter(|x| x.judgement == j).find_map(hint);
            of.map_or_else(String::new, |hint| format!("; first, {hint}"))
        };
        match self.judgement {
            Judgement::Good => writeln!(f, "go on: nothing speaks against this record; next, ffid identify"),
            Judgement::Suspicious => {
                writeln!(f, "go on with care: {suspicious} suspicious{}", first(Judgement::Suspicious))
            }
            Judgement::Wrong => {
                let hint = first(Judgement::Wrong);
                writeln!(f, "do not fit this record: {wrong} wrong, {suspicious} suspicious{hint}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::diagnosis::{Diagnosis, Finding, Judgement, Topic};
    use ff_model::{Area, Problem};

    #[test]
    fn the_last_line_counts_everything_and_has_no_empty_part() {
        let finding = |problem: Option<Problem>| Finding {
            problem,
            ..Finding::new("a.csv", Topic::Gaps, Judgement::Suspicious, "3 samples lost")
        };
        let last = |all: Vec<Finding>| {
            let text = Diagnosis::new("robot", all).to_string();
            text.trim_end().lines().last().unwrap_or_default().to_owned()
        };
        assert_eq!(last(vec![finding(None)]), "go on with care: 1 suspicious");
        let p = Problem::warning(Area::Data, "Data::NoiseFigure", "noise").hint("look at the sensor");
        assert_eq!(
            last(vec![finding(None), finding(Some(p))]),
            "go on with care: 2 suspicious; first, look at the sensor"
        );
    }
}
