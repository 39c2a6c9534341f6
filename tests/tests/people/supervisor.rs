//! What systemd hears: a socket stands in its place, as `NOTIFY_SOCKET` names it.

use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use inekf_tests::folder::Folder;
use inekf_tests::memory::Memory;
use inekf_tests::process::{PATIENCE, Running, config_file};
use inekf_tests::programs::programs;
use rustix::process::Signal;

const CONFIG: &str = "\
model = 'imu'
[noise]
gyro_density = 3e-4
accel_density = 2e-2
[health]
period_s = 0.05
";

#[test]
fn systemd_hears_that_the_daemon_is_ready_alive_and_stopping() {
    let folder = Folder::new();
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    let hear = || {
        let mut buffer = [0; 256];
        let length = socket.recv(&mut buffer).expect("the daemon says something");
        String::from_utf8_lossy(&buffer[..length]).into_owned()
    };
    let memory = Memory::new();
    let (_config, file) = config_file(CONFIG);
    let mut command = memory.command(&programs().service);
    command
        .env("NOTIFY_SOCKET", &path)
        .arg("--config")
        .arg(file);
    let daemon = Running::start(command);
    // First that it is ready: its ports are open by then.
    assert_eq!(hear().trim(), "READY=1");
    assert!(daemon.stdout().starts_with("ready"));
    for _ in 0..3 {
        let said = hear();
        assert!(
            said.contains("WATCHDOG=1") && said.contains("STATUS=waiting"),
            "{said}"
        );
    }
    daemon.signal(Signal::TERM);
    let last = loop {
        let said = hear();
        if !said.contains("WATCHDOG=1") {
            break said;
        }
    };
    assert_eq!(last.trim(), "STOPPING=1");
    daemon.wait().succeeded();
    socket
        .set_read_timeout(Some(Duration::from_millis(1)))
        .unwrap();
    assert!(socket.recv(&mut [0; 16]).is_err());
}
