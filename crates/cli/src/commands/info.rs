use crate::Outcome;
use crate::args::{Global, InfoArgs};
use crate::site_info::{RelationInfo, SiteInfo};
use crate::terminal::print;
use anyhow::{Result, bail};

/// Says what is in a manifold file.
pub fn run(args: &InfoArgs, global: &Global) -> Result<Outcome> {
    let read = store::read(&args.file)?;
    let bytes = std::fs::metadata(&args.file)?.len();
    let mut info = SiteInfo::new(&args.file, bytes, &read);
    if args.relations {
        info.listed = Some(RelationInfo::all(&read.site.manifold));
    }
    if args.verify {
        info.findings = Some(store::verify(&args.file)?.iter().map(ToString::to_string).collect());
    }
    print(global, &info.to_text(), &info)?;
    match info.findings {
        Some(findings) if !findings.is_empty() => {
            bail!("{}: {}", args.file.display(), findings.join("; "))
        }
        _ => Ok(Outcome::Fine),
    }
}
