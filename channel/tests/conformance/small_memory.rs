//! Little shared memory: errors that name the cause, and no signal.

use std::ffi::CString;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};

use tactnet_channel::{
    Bus, ChannelConfig, ChannelError, Domain, Hub, MEMORY_FOLDER_VARIABLE, Priority, Start, Table,
    free_memory,
};

/// Free memory to try, in KiB: none, what iceoryx2's small files need, and what is enough for some of the ports.
const FREE_KIB: [u64; 14] = [0, 4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 256, 512, 1024];

/// Returns `unshare` for a mount namespace, if this process may create one.
fn unshare() -> Option<Command> {
    let command = |program: &str| {
        let mut unshare = Command::new("unshare");
        unshare.args(["--mount", "--map-root-user", program]);
        unshare
    };
    let mut probe = command("true");
    probe.stdout(Stdio::null()).stderr(Stdio::null());
    let allowed = probe.status().is_ok_and(|status| status.success());
    allowed.then(|| command(std::env::current_exe().unwrap().to_str().unwrap()))
}

#[test]
fn a_lack_of_shared_memory_is_an_error_that_names_the_remedy() {
    let Some(mut unshare) = unshare() else {
        eprintln!("SKIPPED: mount namespaces are not permitted");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let run = unshare
        .args(["--ignored", "--exact", "--nocapture", "--test-threads=1"])
        .arg("small_memory::in_a_small_folder")
        .env(MEMORY_FOLDER_VARIABLE, folder.path())
        .output()
        .unwrap();
    let output = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.signal(), None, "{output}");
    assert!(run.status.success(), "{output}");
    assert!(output.contains("1 passed"), "{output}");
}

/// Not a separate test: runs in the mount namespace of the test above.
#[test]
#[ignore = "needs a mount namespace, in which the test above runs it"]
fn in_a_small_folder() {
    let Some(folder) = std::env::var_os(MEMORY_FOLDER_VARIABLE) else {
        return;
    };
    let folder = Path::new(&folder);
    mount(folder, "size=2m,mode=700");
    let table = Table::new("small").with(
        "a",
        ChannelConfig {
            put_ports: 4,
            ..ChannelConfig::of::<f32>(256)
        },
    );
    for free in FREE_KIB {
        let filler = Filler::leave(folder, free);
        if let Err(error) = Hub::start(&table) {
            check(&error, folder);
        }
        drop(filler);
        tactnet_channel::remove_bus(&table).unwrap();
        let _hub = Hub::start(&table).unwrap();
        let filler = Filler::leave(folder, free);
        if let Err(error) = client(&table) {
            check(&error, folder);
        }
        drop(filler);
        // With enough memory everything works again.
        client(&table).unwrap();
    }
}

/// Opens ports and exchanges packets.
fn client(table: &Table) -> Result<(), ChannelError> {
    let bus = Bus::open(Domain::Host, table)?;
    let get = bus.get_port::<f32>("a", Start::Now)?;
    // Several ports at once compete for the rest.
    let puts: Vec<_> = std::thread::scope(|scope| {
        let threads = [(); 4].map(|()| {
            scope.spawn(|| {
                let put = bus.put_port::<f32>("a", Priority::Normal)?;
                put.put_copy(&[1.5; 256])?;
                Ok(put)
            })
        });
        threads.map(|thread| thread.join().unwrap()).into()
    });
    while get.try_get()?.is_some() {}
    puts.into_iter().try_for_each(|put| put.map(drop))
}

fn check(error: &ChannelError, folder: &Path) {
    let text = error.to_string();
    assert!(matches!(error, ChannelError::Memory { .. }), "{text}");
    for part in ["bytes", "free", "--shm-size", folder.to_str().unwrap()] {
        assert!(text.contains(part), "{text}");
    }
}

fn mount(folder: &Path, options: &str) {
    let [kind, folder, options] =
        ["tmpfs", folder.to_str().unwrap(), options].map(|text| CString::new(text).unwrap());
    // SAFETY: valid texts.
    let failed = unsafe {
        libc::mount(
            kind.as_ptr(),
            folder.as_ptr(),
            kind.as_ptr(),
            0,
            options.as_ptr().cast(),
        )
    };
    assert_eq!(failed, 0, "{}", std::io::Error::last_os_error());
}

/// File that fills the memory; removed when dropped.
struct Filler(std::path::PathBuf);

impl Filler {
    fn leave(folder: &Path, kib: u64) -> Self {
        let path = folder.join("filler");
        let bytes = free_memory(folder).saturating_sub(kib << 10);
        std::fs::write(&path, vec![1; bytes as usize]).unwrap();
        Self(path)
    }
}

impl Drop for Filler {
    fn drop(&mut self) {
        std::fs::remove_file(&self.0).unwrap();
    }
}
