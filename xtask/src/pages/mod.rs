//! `cargo xtask pages --check`: every kind of page, opened in headless Chromium on a desk and on a phone, in light and in dark.
//!
//! Written anew from the fixtures: `ffid show` without and with a motion and of every kind of appendage, report and replay of an
//! identification, the verdict on a trajectory, the report of `cargo xtask reproduce` (of a quick run where there is none yet). Asked of each: no error or warning of
//! the console, no request, nothing wider than the window, readable contrast, plots that zoom and tell values, a 3-D view that is not blank,
//! plays, and whose controls answer (`check.js`).

mod browser;

use crate::table::Table;
use crate::workspace;
use anyhow::{Context, ensure};
use browser::Browser;
use ffid::exit::{Exit, Failure};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

const CHECK: &str = include_str!("check.js");
/// Windows: name, width and height (px), dark.
const WINDOWS: [(&str, (u32, u32), bool); 3] =
    [("desk", (1400, 900), false), ("phone", (400, 800), false), ("dark", (800, 600), true)];
/// Largest report and replay (bytes).
const LARGEST: u64 = 3 << 20;

/// Arguments of `pages`.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// Open every page in Chromium (of $CHROMIUM, or on the path) and ask it
    #[arg(long)]
    pub check: bool,
    /// Folder for the pages; target/pages unless given. It is emptied first
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Keep a picture of every page in every window
    #[arg(long, requires = "check")]
    pub pictures: bool,
}

/// Writes the pages and, when asked for, checks them.
///
/// # Errors
/// [`Failure::Tolerance`] naming every fault of a page; [`Failure::Io`] without a browser or a place to write; what the commands refuse.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let root = workspace::root()?;
    let out = args.out.clone().unwrap_or_else(|| root.join("target/pages"));
    // Before the pages, which take longer.
    let program = match (args.check, browser::find()) {
        (true, None) => {
            let e = std::io::Error::new(
                std::io::ErrorKind::NotFound,
                "install Debian's chromium, or name one in $CHROMIUM",
            );
            return Err(Failure::io("find", Path::new("chromium"), e).into());
        }
        (_, found) => found,
    };
    if out.exists() {
        fs::remove_dir_all(&out).map_err(|e| Failure::io("empty", &out, e))?;
    }
    fs::create_dir_all(&out).map_err(|e| Failure::io("make", &out, e))?;
    let mut pages = write(&root, &out)?;
    // The report of the whole study where there is one, and else that of a quick one.
    let study = root.join("target/reproduce/report.html");
    pages.push(if study.is_file() { study } else { quick_study(&out)? });
    println!("{} pages in {}", pages.len(), out.display());
    if let (true, Some(program)) = (args.check, program) {
        check(&mut Browser::start(&program)?, &pages, &out, args.pictures)?;
    }
    Ok(())
}

fn quick_study(out: &Path) -> anyhow::Result<PathBuf> {
    let folder = out.join("reproduce");
    crate::reproduce::run(&crate::reproduce::Args { out: folder.clone(), quick: true, sweep: None })?;
    Ok(folder.join("report.html"))
}

fn check(browser: &mut Browser, pages: &[PathBuf], out: &Path, pictures: bool) -> anyhow::Result<()> {
    let mut table = Table::new("Pages", &["page", "kB", "window", "faults", "frames/s"]).left(1);
    let mut faults = Vec::new();
    for page in pages {
        let name = page.strip_prefix(out).unwrap_or(page).display().to_string();
        let bytes = fs::metadata(page).map_err(|e| Failure::io("read", page, e))?.len();
        if bytes > LARGEST {
            faults.push(format!("{name}: {bytes} bytes, limit {LARGEST}"));
        }
        for (window, size, dark) in WINDOWS {
            let begun = Instant::now();
            browser.open(page, size, dark)?;
            let answer = browser.evaluate(CHECK).with_context(|| format!("{name}, {window}"))?;
            let found = answer["problems"].as_array().context("no answer of check.js")?;
            let mut own: Vec<String> = found.iter().filter_map(Value::as_str).map(str::to_owned).collect();
            own.extend(browser.complaints());
            if pictures {
                let file = out.join(format!("{}-{window}.png", name.replace(['/', '.'], "-")));
                fs::write(&file, browser.picture()?).map_err(|e| Failure::io("write", &file, e))?;
            }
            let rate = answer["frames_per_second"].as_f64().map_or_else(String::new, |r| format!("{r:.0}"));
            table.row(vec![name.clone(), (bytes / 1000).to_string(), window.to_owned(), own.len().to_string(), rate]);
            eprintln!("{name}, {window}: {} faults, {:.1} s", own.len(), begun.elapsed().as_secs_f64());
            faults.extend(own.into_iter().map(|f| format!("{name}, {window}: {f}")));
        }
    }
    println!("{table}");
    faults.iter().for_each(|f| println!("{f}"));
    ensure!(faults.is_empty(), Failure::Tolerance(format!("{} faults of pages", faults.len())));
    Ok(())
}

/// Every kind of page, by the command itself.
fn write(root: &Path, out: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (paper, kinds) = (root.join("fixtures/paper/combined.toml"), root.join("fixtures/kinds/all.toml"));
    let text = |p: &Path| p.to_string_lossy().into_owned();
    let at = |name: &str| out.join(name);
    let motion = at("motion.csv");
    fs::write(&motion, nod()).map_err(|e| Failure::io("write", &motion, e))?;
    let (paper, motion) = (text(&paper), text(&motion));
    ffid(&["show", &paper, "--out", &text(&at("pose.html"))])?;
    ffid(&["show", &paper, "--trajectory", &motion, "--hold", "10", "--out", &text(&at("motion.html"))])?;
    ffid(&["show", &text(&kinds), "--out", &text(&at("kinds.html"))])?;
    ffid(&["plan", &paper, "--trajectory", &motion, "--out", &text(&at("plan"))])?;
    let record = text(&at("record.csv"));
    ffid(&["simulate", &paper, "--trajectory", &motion, "--hold", "10", "--seed", "3", "--out", &record])?;
    let fit = text(&at("fit"));
    ffid(&["identify", &paper, "--record", &record, "--held-out", "0.3", "--out", &fit])?;
    let names = ["pose.html", "motion.html", "kinds.html", "plan/report.html", "fit/report.html", "fit/replay.html"];
    let pages: Vec<PathBuf> = names.iter().map(|n| out.join(n)).collect();
    for p in &pages {
        ensure!(p.is_file(), "{} was not written", p.display());
    }
    Ok(pages)
}

/// A motion of all joints from the hold pose of the paper and back, 30 s.
fn nod() -> String {
    const HOLD: [f64; 7] = [core::f64::consts::FRAC_PI_2, 1.4, 0.0, -2.6, 0.0, 2.4, 0.0];
    const SECONDS: f64 = 30.0;
    let mut out = "time[s]".to_owned();
    (1..=7).for_each(|j| out.push_str(&format!(",q.joint{j}[rad]")));
    out.push('\n');
    for i in 0..=3000 {
        let t = f64::from(i) * 0.01;
        // Starts and ends at rest.
        let window = 0.5 - 0.5 * (std::f64::consts::TAU * t / SECONDS).cos();
        let joints = HOLD.iter().enumerate().map(|(j, q)| q + 0.4 * window * (0.5 * t * (1.0 + 0.15 * j as f64)).sin());
        let row: Vec<String> = [t].into_iter().chain(joints).map(|x| format!("{x:.9}")).collect();
        out.push_str(&row.join(","));
        out.push('\n');
    }
    out
}

/// Runs the command; what it finds fault with in a robot or record is no fault of a page.
fn ffid(args: &[&str]) -> anyhow::Result<()> {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let all: Vec<&str> = ["ffid"].into_iter().chain(args.iter().copied()).collect();
    let exit = ffid_cli::run(&all, &mut out, &mut err);
    let judged = [Exit::Done, Exit::IllPosed, Exit::Contradicted, Exit::NotTested].contains(&exit);
    ensure!(judged, "ffid {}: {}", args.join(" "), String::from_utf8_lossy(&err));
    Ok(())
}

/// Bytes of a text in base64 (RFC 4648, section 4).
fn base64(text: &str) -> anyhow::Result<Vec<u8>> {
    use ::base64::Engine;
    Ok(::base64::engine::general_purpose::STANDARD.decode(text)?)
}
