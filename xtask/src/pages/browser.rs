//! Headless Chromium by the DevTools protocol over two pipes: no port, no library.

use anyhow::{Context, bail, ensure};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Names under which Chromium is installed.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];
/// Longest wait for an answer: pages are drawn by software.
const PATIENCE: Duration = Duration::from_secs(120);
/// Chromium speaks on descriptors 3 and 4; the shell puts the pipes there.
const START: &str = "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null";

/// The browser of `$CHROMIUM`, or the first of the usual names on the path.
pub(super) fn find() -> Option<PathBuf> {
    if let Some(own) = std::env::var_os("CHROMIUM") {
        return Some(PathBuf::from(own));
    }
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    NAMES.iter().flat_map(|n| folders.iter().map(move |f| f.join(n))).find(|p| p.is_file())
}

/// A running browser with one page.
pub(super) struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    session: String,
    last: u64,
    /// What the page said since it was opened.
    events: Vec<Value>,
    /// Profile, removed at the end.
    _profile: Profile,
}

struct Profile(PathBuf);
impl Drop for Profile {
    fn drop(&mut self) {
        // A leftover in the folder of temporary files is no error of a check.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

impl Browser {
    /// Starts `program` and opens an empty page.
    pub(super) fn start(program: &Path) -> anyhow::Result<Self> {
        let profile = std::env::temp_dir().join(format!("ffid-pages-{}", std::process::id()));
        let mut child = Command::new("sh")
            .args(["-c", START])
            .arg(program)
            .args(["--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--no-first-run", "--hide-scrollbars"])
            .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"])
            // A plot drawn by the software GPU is read back from it in a third of a second, and a report has 50 of them.
            .arg("--disable-accelerated-2d-canvas")
            .arg(format!("--user-data-dir={}", profile.display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .with_context(|| format!("start {}", program.display()))?;
        let (to, from) =
            (child.stdin.take().context("no pipe to it")?, child.stdout.take().context("no pipe from it")?);
        let (send, receive) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(from).split(0) {
                let Some(value) = message.ok().and_then(|m| serde_json::from_slice(&m).ok()) else { return };
                if send.send(value).is_err() {
                    return;
                }
            }
        });
        let (session, events) = (String::new(), Vec::new());
        let mut b = Self { child, to, from: receive, session, last: 0, events, _profile: Profile(profile) };
        let target = b.call("Target.createTarget", &json!({ "url": "about:blank" }))?;
        let session = b.call("Target.attachToTarget", &json!({ "targetId": target["targetId"], "flatten": true }))?;
        b.session = session["sessionId"].as_str().context("no session")?.to_owned();
        for domain in ["Page", "Runtime", "Log", "Network"] {
            b.call(&format!("{domain}.enable"), &json!({}))?;
        }
        Ok(b)
    }
    /// Sends a command and waits for its answer; events on the way are kept.
    fn call(&mut self, method: &str, params: &Value) -> anyhow::Result<Value> {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": params });
        if !self.session.is_empty() {
            message["sessionId"] = Value::from(self.session.as_str());
        }
        let mut bytes = serde_json::to_vec(&message)?;
        bytes.push(0);
        self.to.write_all(&bytes).and_then(|()| self.to.flush()).context("the browser has ended")?;
        loop {
            let answer = self.from.recv_timeout(PATIENCE).with_context(|| format!("no answer to {method}"))?;
            if answer["id"] == self.last {
                if let Some(e) = answer.get("error") {
                    bail!("{method}: {e}");
                }
                return Ok(answer["result"].clone());
            }
            self.events.push(answer);
        }
    }
    /// Opens a file in a window of this size, in light or dark colours, and waits until it is loaded.
    pub(super) fn open(&mut self, file: &Path, (width, height): (u32, u32), dark: bool) -> anyhow::Result<()> {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", &size)?;
        let scheme = json!({ "name": "prefers-color-scheme", "value": if dark { "dark" } else { "light" } });
        self.call("Emulation.setEmulatedMedia", &json!({ "features": [scheme] }))?;
        self.events.clear();
        let url = format!("file://{}", std::path::absolute(file)?.display());
        self.call("Page.navigate", &json!({ "url": url }))?;
        while !self.events.iter().any(|e| e["method"] == "Page.loadEventFired") {
            let event = self.from.recv_timeout(PATIENCE).with_context(|| format!("{url} does not load"))?;
            self.events.push(event);
        }
        Ok(())
    }
    /// The value of an expression in the page, awaited.
    pub(super) fn evaluate(&mut self, expression: &str) -> anyhow::Result<Value> {
        let asked = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.call("Runtime.evaluate", &asked)?;
        ensure!(answer.get("exceptionDetails").is_none(), "the check itself failed: {}", answer["exceptionDetails"]);
        Ok(answer["result"]["value"].clone())
    }
    /// A picture of the window as PNG.
    pub(super) fn picture(&mut self) -> anyhow::Result<Vec<u8>> {
        let answer = self.call("Page.captureScreenshot", &json!({ "format": "png" }))?;
        super::base64(answer["data"].as_str().unwrap_or_default())
    }
    /// Errors and warnings of the console, exceptions, and requests to anywhere but the page, since it was opened.
    pub(super) fn complaints(&self) -> Vec<String> {
        let said = |e: &Value| -> Option<String> {
            let p = &e["params"];
            match e["method"].as_str()? {
                "Runtime.exceptionThrown" => {
                    Some(format!("exception: {}", p["exceptionDetails"]["exception"]["description"]))
                }
                "Runtime.consoleAPICalled" if matches!(p["type"].as_str(), Some("error" | "warning")) => {
                    Some(format!("console: {}", p["args"]))
                }
                "Log.entryAdded" if p["entry"]["level"] == "error" => Some(format!("console: {}", p["entry"]["text"])),
                // The page itself is a request, and so is the icon that a browser looks for beside it.
                "Network.requestWillBeSent" => {
                    let url = p["request"]["url"].as_str().unwrap_or_default();
                    let own = p["type"] == "Document" || url.starts_with("data:");
                    (!own).then(|| format!("request to {url}"))
                }
                _ => None,
            }
        };
        self.events.iter().filter_map(said).collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It ends with its pipe; what does not is ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
