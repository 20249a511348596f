use crate::runner::Run;
use crate::{cargo, inputs};
use anyhow::{Context, Result, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder that disappears with its value.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Result<Self> {
        let path = std::env::temp_dir().join(format!("manifoldslam-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).context(path.display().to_string())?;
        Ok(Scratch(path))
    }

    fn file(&self, name: &str, bytes: &[u8]) -> Result<String> {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).context(path.display().to_string())?;
        Ok(path.display().to_string())
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Nothing depends on it.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Runs all example targets whose name begins with a number.
pub fn examples(run: &mut Run) -> Result<()> {
    let mut names = Vec::new();
    for package in run.workspace.packages() {
        for target in package["targets"].as_array().into_iter().flatten() {
            let name = target["name"].as_str().unwrap_or_default();
            let example = target["kind"][0] == "example";
            if example && name.starts_with(|c: char| c.is_ascii_digit()) {
                let package = package["name"].as_str().unwrap_or_default();
                names.push((name.to_owned(), package.to_owned()));
            }
        }
    }
    names.sort();
    ensure!(!names.is_empty(), "there are no numbered examples");
    for (name, package) in &names {
        cargo::run(&["run", "--release", "--locked", "--quiet", "-p", package, "--example", name])?;
    }
    run.note(format!("{} numbered examples ran", names.len()));
    Ok(())
}

/// What a result folder holds besides one trajectory per log.
const RESULTS: [&str; 7] =
    ["map.png", "map.pgm", "map.yaml", "graph.g2o", "config.toml", "metrics.json", "report.html"];
/// What differs from run to run: it holds times.
const TIMED: [&str; 3] = ["metrics.json", "report.html", "site.manifold"];

/// The main job on the built-in building, twice.
pub fn demo(run: &mut Run) -> Result<()> {
    let scratch = Scratch::new("demo")?;
    let folders = ["1", "2"].map(|threads| (threads, scratch.0.join(threads)));
    for (threads, folder) in &folders {
        let output = folder.display().to_string();
        cargo::run(&["demo", "--quiet", "--threads", threads, "-o", &output])?;
    }
    let [(_, one), (_, two)] = &folders;
    for name in RESULTS {
        ensure!(std::fs::metadata(one.join(name))?.len() > 0, "{name} is empty");
    }
    let (files, others) = (files_below(one)?, files_below(two)?);
    ensure!(files == others, "one thread wrote {files:?}, two wrote {others:?}");
    ensure!(files.iter().any(|f| f.extension().is_some_and(|e| e == "tum")), "no trajectory");
    let mut compared = 0;
    for file in files.iter().filter(|f| !TIMED.iter().any(|timed| f.ends_with(timed))) {
        let same = std::fs::read(one.join(file))? == std::fs::read(two.join(file))?;
        ensure!(same, "{} depends on the number of threads", file.display());
        compared += 1;
    }
    run.note(format!("the demo ran twice; {compared} of its files compared byte by byte"));
    Ok(())
}

/// Files below a folder, relative to it; sorted.
fn files_below(root: &Path) -> Result<Vec<PathBuf>> {
    let (mut files, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).context(folder.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path.strip_prefix(root)?.to_owned());
            }
        }
    }
    files.sort();
    Ok(files)
}

/// One command with bad input, and what must come of it.
struct Case {
    arguments: Vec<String>,
    /// Exit codes that are right.
    codes: &'static [i32],
    /// What the message must name.
    names: String,
    /// A result that must not exist if the command fails.
    result: Option<PathBuf>,
}

/// Every case of bad input ends with a message that names the file, the right exit code, no panic,
/// and no result that looks whole.
pub fn bad_input(run: &mut Run) -> Result<()> {
    let program = run.workspace.program();
    ensure!(program.is_file(), "{} is not built; run the step `build`", program.display());
    let scratch = Scratch::new("bad-input")?;
    let mut cases = log_cases(&scratch)?;
    cases.extend(usage_cases(&scratch)?);
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|case| objection(&program, case).transpose())
        .collect::<Result<_>>()?;
    run.note(format!("{} commands with bad input or usage", cases.len()));
    if !wrong.is_empty() {
        bail!("{}", wrong.join("\n"));
    }
    Ok(())
}

/// Logs that are damaged or no logs, missing files, folders that cannot be written.
fn log_cases(scratch: &Scratch) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    let mut map = |name: &str, codes| {
        let output = scratch.0.join(format!("out-{name}"));
        cases.push(Case {
            arguments: words(&["map", &scratch.0.join(name).display().to_string(), "-o"])
                .into_iter()
                .chain([output.display().to_string()])
                .collect(),
            codes,
            names: name.to_owned(),
            result: Some(output.join("map.png")),
        });
    };
    for (name, bytes) in inputs::damaged() {
        scratch.file(name, &bytes)?;
        map(name, &[0, 3]);
    }
    for (name, bytes) in inputs::hopeless() {
        scratch.file(name, &bytes)?;
        map(name, &[1, 3]);
    }
    map("missing.clf", &[1]);
    Ok(cases)
}

/// Wrong usage, settings and outputs.
fn usage_cases(scratch: &Scratch) -> Result<Vec<Case>> {
    let good = scratch.file("good.clf", inputs::log(40).as_bytes())?;
    let settings = scratch.file("unknown.toml", b"no_such_setting = 1\n")?;
    let garbage = scratch.file("garbage.g2o", b"VERTEX_SE2 0 x y z\nEDGE_SE2 1\n\x00\xff")?;
    let below_file = format!("{good}/out");
    let output = scratch.0.join("out-usage").display().to_string();
    let absent = scratch.0.join("absent.g2o").display().to_string();
    let case = |arguments: &[&str], codes, names: &str| Case {
        arguments: words(arguments),
        codes,
        names: names.to_owned(),
        result: None,
    };
    Ok(vec![
        case(&[], &[2], ""),
        case(&["no-such-command"], &[2], "no-such-command"),
        case(&["map", "-o", &output], &[2], ""),
        case(&["map", &good, "-o", &output, "--no-such-option"], &[2], "no-such-option"),
        case(&["map", &good, "-o", &output, "--threads", "none"], &[2], "threads"),
        case(&["map", &good, "-o", &output, "--config", &settings], &[1, 2], "no_such_setting"),
        case(&["map", &good, "-o", &below_file], &[1], "good.clf"),
        case(&["optimize", &absent, "-o", &output], &[1], "absent.g2o"),
        case(&["optimize", &garbage, "-o", &output], &[1, 3], "garbage.g2o"),
        case(
            &["render", &absent, "--log", &good, "-o", &format!("{output}.png")],
            &[1],
            "absent.g2o",
        ),
        case(&["eval", "ate"], &[2], ""),
    ])
}

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// What is wrong with how the program took a case, if anything.
fn objection(program: &Path, case: &Case) -> Result<Option<String>> {
    let output = Command::new(program).args(&case.arguments).output().context("manifoldslam")?;
    let code = output.status.code().unwrap_or(-1);
    // Errors go to standard error; what was lost of a log stands in the account on standard output.
    let mut message = String::from_utf8_lossy(&output.stderr).into_owned();
    message.push_str(&String::from_utf8_lossy(&output.stdout));
    let left = case.result.as_ref().filter(|result| code == 1 && result.exists());
    let problem = if !case.codes.contains(&code) {
        format!("exit code {code}, not one of {:?}", case.codes)
    } else if message.contains("panicked") {
        "it panicked".to_owned()
    } else if code != 0 && !message.contains(&case.names) {
        format!("the message does not name {}", case.names)
    } else if code != 0 && message.trim().is_empty() {
        "there is no message".to_owned()
    } else if let Some(result) = left {
        format!("it failed and left {}", result.display())
    } else {
        return Ok(None);
    };
    let end: String = message.chars().take(600).collect();
    Ok(Some(format!("manifoldslam {}: {problem}\n{end}", case.arguments.join(" "))))
}
