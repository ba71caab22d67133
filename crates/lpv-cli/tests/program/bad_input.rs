//! Every broken bundle through the program: one message, exit code 2, nothing written.

use crate::broken::{Case, cases};
use crate::common::{Desk, files, message_of};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is wrong with how the program takes a case.
fn complaint(case: &Case) -> Option<String> {
    let desk = Desk::new();
    std::fs::create_dir(desk.path("bundle")).unwrap();
    (case.build)(&desk.path("bundle"));
    let before = files(&desk.path("."));
    for line in ["inspect bundle", "identify bundle -o result/model.json"] {
        let out = desk.lpv(line);
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        if out.status.code() != Some(2) {
            return Some(format!("{line} ends with {:?}: {text}", out.status.code()));
        }
        let message = message_of(line, &out);
        // Records that are held out are not read by `identify`, which has less to fit than it needs here anyway.
        let read = line.starts_with("inspect") || !case.message.iter().any(|m| m.contains("(records[1])"));
        if let Some(part) = case.message.iter().find(|part| read && !message.contains(**part)) {
            return Some(format!("{line}: `{part}` is missing in {message}"));
        }
        if message.trim_end().contains('\n') {
            return Some(format!("{line}: more than one line: {message}"));
        }
    }
    (files(&desk.path(".")) != before).then(|| "a file was written or changed".to_owned())
}

#[test]
fn every_broken_bundle_ends_in_one_message() {
    let all = cases();
    assert!(all.len() >= 60, "{}", all.len());
    let (next, wrong) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let workers = std::thread::available_parallelism().map_or(2, |n| n.get().max(2));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some(case) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Some(complaint) = complaint(case) {
                        wrong.lock().unwrap().push(format!("{}: {complaint}", case.name));
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
