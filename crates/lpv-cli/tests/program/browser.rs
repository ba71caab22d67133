//! A browser that obeys a test, where Chromium and its driver are installed: the WebDriver protocol over a socket.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

/// Columns and rows of a [`Browser::fingerprint`].
pub(crate) const CELLS: (usize, usize) = (32, 20);

/// A browser without a window, a profile of its own and no network.
pub(crate) struct Browser {
    driver: Child,
    port: u16,
    session: String,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// None, with a message, where there is no `chromedriver` or it finds no browser.
    pub(crate) fn start() -> Option<Self> {
        let driver = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut driver) = driver else {
            eprintln!("skipped: there is no `chromedriver`");
            return None;
        };
        let told = BufReader::new(driver.stdout.take().unwrap()).lines();
        let port = told.map_while(Result::ok).find_map(|line| {
            let (_, port) = line.split_once("successfully on port ")?;
            port.trim_end_matches('.').parse().ok()
        });
        let profile = tempfile::tempdir().unwrap();
        let mut browser = Self {
            driver,
            port: port.unwrap(),
            session: String::new(),
            _profile: profile,
        };
        let folder = format!("--user-data-dir={}", browser._profile.path().display());
        let flags = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            &folder,
        ];
        let wanted = json!({"goog:chromeOptions": {"args": flags}, "goog:loggingPrefs": {"browser": "ALL"}});
        match browser.ask(
            "POST",
            "/session",
            &json!({"capabilities": {"alwaysMatch": wanted}}),
        ) {
            Ok(answer) => browser.session = answer["sessionId"].as_str().unwrap().to_owned(),
            Err(message) => {
                eprintln!("skipped: `chromedriver` starts no browser: {message}");
                return None;
            }
        }
        Some(browser)
    }

    fn ask(&self, method: &str, path: &str, body: &Value) -> Result<Value, String> {
        let body = match body {
            Value::Null => String::new(),
            body => body.to_string(),
        };
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n{body}",
            self.port,
            body.len()
        )
        .unwrap();
        let mut reader = BufReader::new(stream);
        let mut length = 0;
        loop {
            let mut line = String::new();
            reader.read_line(&mut line).unwrap();
            if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
                length = value.trim().parse().unwrap();
            }
            if line.trim().is_empty() {
                break;
            }
        }
        let mut answer = vec![0; length];
        reader.read_exact(&mut answer).unwrap();
        let answer: Value = serde_json::from_slice(&answer).unwrap();
        match answer["value"]["error"].as_str() {
            Some(error) => Err(format!("{error}: {}", answer["value"]["message"])),
            None => Ok(answer["value"].clone()),
        }
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        self.ask("POST", &format!("/session/{}{path}", self.session), body)
            .unwrap()
    }

    /// Opens a file in a window of this size, px.
    pub(crate) fn open(&self, page: &Path, [width, height]: [u32; 2]) {
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        let command = json!({"cmd": "Emulation.setDeviceMetricsOverride", "params": size});
        self.post("/goog/cdp/execute", &command);
        self.post("/url", &json!({"url": format!("file://{}", page.display())}));
    }

    /// What the body of a function returns.
    pub(crate) fn run(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({"script": script, "args": []}))
    }

    pub(crate) fn number(&self, expression: &str) -> f64 {
        self.run(&format!("return {expression}")).as_f64().unwrap()
    }

    pub(crate) fn text(&self, expression: &str) -> String {
        let value = self.run(&format!("return String({expression})"));
        value.as_str().unwrap().to_owned()
    }

    /// Presses keys one after the other, with Shift held if it is among them.
    pub(crate) fn press(&self, keys: &[char]) {
        let key = |kind: &str, key: &char| json!({"type": kind, "value": key.to_string()});
        let held: Vec<&char> = keys.iter().filter(|k| **k == SHIFT).collect();
        let mut actions: Vec<Value> = held.iter().map(|k| key("keyDown", k)).collect();
        for each in keys.iter().filter(|k| **k != SHIFT) {
            actions.extend([key("keyDown", each), key("keyUp", each)]);
        }
        actions.extend(held.iter().map(|k| key("keyUp", k)));
        self.post(
            "/actions",
            &json!({"actions": [{"type": "key", "id": "keys", "actions": actions}]}),
        );
    }

    /// Moves the mouse, with its button down from the first place to the last.
    pub(crate) fn drag(&self, places: &[[f64; 2]]) {
        let go =
            |[x, y]: [f64; 2]| json!({"type": "pointerMove", "duration": 20, "x": x.round(), "y": y.round()});
        let mut actions = vec![go(places[0]), json!({"type": "pointerDown", "button": 0})];
        actions.extend(places[1..].iter().map(|p| go(*p)));
        actions.push(json!({"type": "pointerUp", "button": 0}));
        self.post(
            "/actions",
            &json!({"actions": [{"type": "pointer", "id": "mouse", "actions": actions}]}),
        );
    }

    /// Moves the mouse to a place and clicks twice.
    pub(crate) fn double_click(&self, [x, y]: [f64; 2]) {
        let go = json!({"type": "pointerMove", "duration": 0, "x": x.round(), "y": y.round()});
        let [down, up] = ["pointerDown", "pointerUp"].map(|kind| json!({"type": kind, "button": 0}));
        let actions = [&go, &down, &up, &down, &up];
        self.post(
            "/actions",
            &json!({"actions": [{"type": "pointer", "id": "mouse", "actions": actions}]}),
        );
    }

    /// What the browser has complained about: errors of scripts, breaches of the policy of a page.
    pub(crate) fn complaints(&self) -> Value {
        self.post("/se/log", &json!({"type": "browser"}))
    }

    /// A picture of the window, PNG as base64; on a busy machine a browser may need more than one attempt.
    pub(crate) fn picture(&self) -> String {
        let path = format!("/session/{}/goog/cdp/execute", self.session);
        let command = json!({"cmd": "Page.captureScreenshot", "params": {"format": "png"}});
        let mut answer = self.ask("POST", &path, &command);
        for _ in 0..10 {
            if answer.is_ok() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(500));
            answer = self.ask("POST", &path, &command);
        }
        answer.unwrap()["data"].as_str().unwrap().to_owned()
    }

    /// Brightness, 0 to 255, of the cells of a picture, row by row.
    pub(crate) fn fingerprint(&self, picture: &str) -> Vec<f64> {
        self.post("/url", &json!({"url": "about:blank"}));
        let script = "const [data, columns, rows, done] = arguments; const image = new Image(); image.onload = () => {
            const canvas = document.createElement('canvas'); canvas.width = image.width; canvas.height = image.height;
            const pen = canvas.getContext('2d', { willReadFrequently: true }); pen.drawImage(image, 0, 0); const cells = [];
            for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) {
                const [w, h] = [image.width / columns, image.height / rows];
                const d = pen.getImageData(c * w, r * h, w, h).data; let sum = 0;
                for (let i = 0; i < d.length; i += 4) sum += 0.3 * d[i] + 0.6 * d[i + 1] + 0.1 * d[i + 2];
                cells.push(4 * sum / d.length); }
            done(cells); }; image.src = 'data:image/png;base64,' + data;";
        let answer = self.post(
            "/execute/async",
            &json!({"script": script, "args": [picture, CELLS.0, CELLS.1]}),
        );
        let cells = answer.as_array().unwrap().iter();
        cells.map(|v| v.as_f64().unwrap()).collect()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if !self.session.is_empty() {
            let _ = self.ask("DELETE", &format!("/session/{}", self.session), &Value::Null);
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

pub(crate) const TAB: char = '\u{e004}';
pub(crate) const SHIFT: char = '\u{e008}';
pub(crate) const ESCAPE: char = '\u{e00c}';
pub(crate) const RIGHT: char = '\u{e014}';
