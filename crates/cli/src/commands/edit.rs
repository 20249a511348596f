use crate::Outcome;
use crate::args::{EditArgs, Global};
use crate::islands::IslandList;
use crate::mapping::{MappedTeam, MappingTimes, StageClock, keep_result, resume, stored_config};
use crate::result::{figures, write_result};
use crate::result_folder::result_folder_of;
use crate::site_writer::SiteWriter;
use crate::terminal::{counted, print};
use anyhow::{Result, bail};
use manifold::{Manifold, Provenance, Relation, RelationId, RelationState};
use sensing::RobotId;
use slam::Team;
use std::time::Instant;
use store::{SqliteStore, Store};

/// Takes back parts of a map, or confirms them; the map becomes what it would be without what was
/// taken back.
pub fn run(args: &EditArgs, global: &Global) -> Result<Outcome> {
    let start = Instant::now();
    let folder = result_folder_of(&args.file)?;
    let store = SqliteStore::open(&args.file, env!("CARGO_PKG_VERSION"))?;
    let config = stored_config(store.site())?.unwrap_or_default();
    let edits = Edits::of(args, &store.site().manifold)?;
    let clock = StageClock::default();
    let (mut team, robots) = resume(store.site(), config.slam, Box::new(clock.clone()));
    let before = IslandList::of(team.manifold()).islands.len();
    let note = edits.perform(&mut team);
    team.rebuild();
    let writer = SiteWriter::start(store)?;
    keep_result(&writer, &mut team, &note);
    let times = MappingTimes { stages: clock.times(), ..MappingTimes::default() };
    let mapped = MappedTeam::new(team, robots, times, Vec::new());
    let metrics = match folder {
        Some(folder) => write_result(folder, &mapped, &config, start, writer)?,
        None => figures(&mapped, &config, start, writer)?,
    };
    let after = mapped.islands.islands.len();
    let islands = match after == before {
        true => counted(after as u64, "island"),
        false => format!("{before} -> {}", counted(after as u64, "island")),
    };
    let text = format!("{}: {note}; {islands}\n{}", args.file.display(), metrics.to_text());
    print(global, &text, &metrics)?;
    Ok(Outcome::Fine)
}

/// What is to be done, all of it possible.
struct Edits {
    retract: Vec<RelationId>,
    confirm: Vec<RelationId>,
    split: Vec<RobotId>,
    left_out: Vec<(RobotId, bool)>,
    note: String,
}

impl Edits {
    fn of(args: &EditArgs, map: &Manifold) -> Result<Self> {
        let robots = |names: &[String]| -> Result<Vec<RobotId>> {
            names.iter().map(|name| robot(map, name)).collect()
        };
        let all = || map.robots().iter().map(|robot| robot.id).collect();
        let split =
            if args.split.iter().any(String::is_empty) { all() } else { robots(&args.split)? };
        let mut left_out: Vec<_> =
            robots(&args.leave_out)?.into_iter().map(|r| (r, true)).collect();
        left_out.extend(robots(&args.take_in)?.into_iter().map(|r| (r, false)));
        let edits = Edits {
            retract: args.retract.iter().map(|id| retractable(map, *id)).collect::<Result<_>>()?,
            confirm: args.confirm.iter().map(|id| confirmable(map, *id)).collect::<Result<_>>()?,
            split,
            left_out,
            note: note(args),
        };
        Ok(edits)
    }

    /// Does it; returns what it was, in words.
    fn perform(self, team: &mut Team) -> String {
        self.retract.into_iter().for_each(|id| team.retract(id));
        self.confirm.into_iter().for_each(|id| team.confirm(id));
        for robot in self.split {
            team.split(robot);
        }
        self.left_out.into_iter().for_each(|(robot, out)| team.leave_out(robot, out));
        self.note
    }
}

/// What the user asked for, for the file's list of steps.
fn note(args: &EditArgs) -> String {
    let ids = |ids: &[u32]| ids.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let split = match args.split.iter().any(String::is_empty) {
        true => "all robots".to_owned(),
        false => args.split.join(", "),
    };
    let parts = [
        ("retracted", ids(&args.retract)),
        ("confirmed", ids(&args.confirm)),
        ("split", split),
        ("left out", args.leave_out.join(", ")),
        ("taken in", args.take_in.join(", ")),
    ];
    let told = parts.iter().filter(|(_, what)| !what.is_empty());
    told.map(|(deed, what)| format!("{deed} {what}")).collect::<Vec<_>>().join("; ")
}

fn robot(map: &Manifold, name: &str) -> Result<RobotId> {
    let known = map.robots().iter().find(|robot| *robot.name == *name);
    match known {
        Some(robot) => Ok(robot.id),
        None => {
            let names: Vec<&str> = map.robots().iter().map(|robot| &*robot.name).collect();
            bail!("no robot {name}; the map's robots are {}", names.join(", "))
        }
    }
}

fn relation(map: &Manifold, id: u32) -> Result<&Relation> {
    match map.relations().get(id as usize) {
        Some(relation) => Ok(relation),
        None => bail!("no relation {id}; the map has {}", map.relations().len()),
    }
}

fn retractable(map: &Manifold, id: u32) -> Result<RelationId> {
    let relation = relation(map, id)?;
    match (relation.provenance, relation.state) {
        (Provenance::Sequential, _) => {
            bail!("relation {id} is a robot's own way; closures and merges can be taken back")
        }
        (_, RelationState::Retracted(_)) => bail!("relation {id} is taken back already"),
        _ => Ok(relation.id),
    }
}

fn confirmable(map: &Manifold, id: u32) -> Result<RelationId> {
    let relation = relation(map, id)?;
    match relation.is_active() {
        true => bail!("relation {id} is part of the map already"),
        false => Ok(relation.id),
    }
}
