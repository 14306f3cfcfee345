//! setup.sh: what it finds, what it would install, what it says where it cannot help. Nothing here installs
//! anything: package managers are stand-ins that write down what they were asked, and "install" by putting the
//! files looked for under a folder of the test's own.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

const SETUP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/setup.sh");

#[test]
fn the_script_is_posix_sh_and_executable() {
    let output = Command::new("sh").args(["-n", SETUP]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(fs::read_to_string(SETUP).unwrap().starts_with("#!/bin/sh\n"));
    assert_ne!(fs::metadata(SETUP).unwrap().permissions().mode() & 0o111, 0);
}

#[test]
fn check_says_what_this_machine_has() {
    let output = Command::new("sh").args([SETUP, "--check"]).current_dir("/").output().unwrap();
    let said = said(&output);
    for thing in [
        "Rust ",
        "compiler",
        "Vulkan loader",
        "software Vulkan driver",
        "validation layers",
        "OpenXR",
        "Xvfb",
    ] {
        assert!(said.contains(thing), "{thing:?} expected: {said}");
    }
    match output.status.code() {
        Some(0) => assert!(said.contains("everything needed is there"), "{said}"),
        Some(1) => assert!(said.contains("missing"), "{said}"),
        code => panic!("exit status {code:?}: {said}"),
    }
}

#[test]
fn an_unknown_argument_is_refused() {
    for args in [&["--chekc"][..], &["--check", "now"]] {
        let output = Command::new("sh").arg(SETUP).args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(said(&output).contains("use 'sh setup.sh'"), "{output:?}");
    }
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// A machine made up for a test: a root folder for files, a folder of commands that is its whole PATH, and a log of
/// what its package manager was asked.
struct Machine {
    folder: TempDir,
}

impl Machine {
    fn new(os_release: &str) -> Machine {
        let machine = Machine { folder: tempfile::tempdir().unwrap() };
        for folder in ["bin", "root/etc"] {
            fs::create_dir_all(machine.path(folder)).unwrap();
        }
        fs::write(machine.path("root/etc/os-release"), os_release).unwrap();
        for tool in
            ["sh", "dirname", "sed", "awk", "tr", "grep", "uname", "env", "cat", "mkdir", "touch", "chmod"]
        {
            symlink(real(tool), machine.path("bin").join(tool)).unwrap();
        }
        machine.command("cargo", "exit 0");
        machine.command("rustc", "echo 'rustc 1.99.1 (0123456 2030-01-01)'");
        machine.command("id", "echo 0");
        machine
    }

    fn path(&self, inside: &str) -> PathBuf {
        self.folder.path().join(inside)
    }

    /// Puts a command on the machine.
    fn command(&self, name: &str, script: &str) {
        let path = self.path("bin").join(name);
        fs::write(&path, format!("#!{}\n{script}\n", real("sh").display())).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// A package manager that notes its arguments, and where asked to install puts everything in place.
    fn package_manager(&self, name: &str) {
        let (log, root, bin) = (self.path("log"), self.path("root"), self.path("bin"));
        let (log, root, bin) = (log.display(), root.display(), bin.display());
        self.command(
            name,
            &format!(
                "echo \"{name} $*\" >> {log}
                 case \" $* \" in *' install '* | *' -S '*) ;; *) exit 0 ;; esac
                 mkdir -p {root}/usr/lib {root}/usr/share/vulkan/icd.d {root}/usr/share/vulkan/explicit_layer.d
                 touch {root}/usr/lib/libvulkan.so.1 {root}/usr/lib/libopenxr_loader.so.1
                 touch {root}/usr/share/vulkan/icd.d/lvp_icd.x86_64.json
                 mkdir -p {root}/usr/include; touch {root}/usr/include/libudev.h
                 mkdir -p {root}/usr/include/alsa; touch {root}/usr/include/alsa/asoundlib.h
                 mkdir -p {root}/usr/include/openxr {root}/usr/include/vulkan
                 touch {root}/usr/include/openxr/openxr.h {root}/usr/include/vulkan/vulkan.h
                 mkdir -p {root}/usr/share/openxr/1/api_layers/explicit.d
                 touch {root}/usr/share/openxr/1/api_layers/explicit.d/XrApiLayer_core_validation.json
                 touch {root}/usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json
                 for tool in cc pkg-config Xvfb xdotool hello_xr; do touch {bin}/$tool; chmod +x {bin}/$tool; done"
            ),
        );
    }

    /// Everything looked for, put there by hand.
    fn furnish(&self) {
        self.package_manager("by-hand");
        assert!(
            Command::new(self.path("bin/by-hand"))
                .arg("install")
                .arg("all")
                .env("PATH", self.path("bin"))
                .status()
                .unwrap()
                .success()
        );
        fs::remove_file(self.path("log")).unwrap();
    }

    fn setup(&self, args: &[&str]) -> Output {
        Command::new(real("sh"))
            .arg(SETUP)
            .args(args)
            .env_clear()
            .env("PATH", self.path("bin"))
            .env("HOME", self.folder.path())
            .env("FATHOMLESS_ROOT", self.path("root"))
            .output()
            .unwrap()
    }

    /// What the package managers were asked, a line each.
    fn asked(&self) -> String {
        fs::read_to_string(self.path("log")).unwrap_or_default()
    }
}

/// Where a tool is on the real machine.
fn real(tool: &str) -> PathBuf {
    let path = std::env::var_os("PATH").unwrap();
    let found = std::env::split_paths(&path).map(|folder| folder.join(tool)).find(|path| path.is_file());
    found.unwrap_or_else(|| Path::new("/usr/bin").join(tool))
}

fn succeeds(output: &Output) -> String {
    let said = said(output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    said
}

fn fails(output: &Output) -> String {
    let said = said(output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    said
}

#[test]
fn each_distribution_gets_its_packages_once() {
    let cases = [
        (
            "ID=debian\n",
            "apt-get",
            "apt-get update\napt-get install -y --no-install-recommends gcc libc6-dev pkg-config libudev-dev libasound2-dev \
             libvulkan1 mesa-vulkan-drivers vulkan-validationlayers libopenxr-loader1 xvfb xdotool libopenxr-utils openxr-layer-corevalidation \
             libopenxr-dev libvulkan-dev\n",
        ),
        (
            "NAME=\"Linux Mint\"\nID=linuxmint\nID_LIKE=\"ubuntu debian\"\n",
            "apt-get",
            "apt-get update\napt-get install -y --no-install-recommends gcc libc6-dev pkg-config libudev-dev libasound2-dev \
             libvulkan1 mesa-vulkan-drivers vulkan-validationlayers libopenxr-loader1 xvfb xdotool libopenxr-utils openxr-layer-corevalidation \
             libopenxr-dev libvulkan-dev\n",
        ),
        (
            "ID=fedora\nVERSION_ID=42\n",
            "dnf",
            "dnf install -y gcc glibc-devel pkgconf-pkg-config systemd-devel alsa-lib-devel vulkan-loader mesa-vulkan-drivers vulkan-validation-layers openxr-libs \
             xorg-x11-server-Xvfb xdotool openxr openxr-devel vulkan-headers vulkan-loader-devel\n",
        ),
        (
            "ID=arch\n",
            "pacman",
            "pacman -Sy --noconfirm\npacman -S --needed --noconfirm gcc pkgconf systemd-libs alsa-lib vulkan-icd-loader vulkan-swrast \
             vulkan-validation-layers openxr xorg-server-xvfb xdotool vulkan-headers\n",
        ),
    ];
    for (os_release, manager, expected) in cases {
        let machine = Machine::new(os_release);
        machine.package_manager(manager);
        let said = succeeds(&machine.setup(&[]));
        assert!(said.contains("installing: ") && said.contains("everything needed is there"), "{said}");
        assert_eq!(machine.asked(), expected, "{os_release}");

        let again = succeeds(&machine.setup(&[]));
        assert!(again.contains("Xvfb (a display for tests): already there"), "{again}");
        assert_eq!(machine.asked(), expected, "{os_release}: the second run asks for nothing");
    }
}

#[test]
fn only_what_is_missing_is_installed() {
    let machine = Machine::new("ID=debian\n");
    machine.furnish();
    machine.package_manager("apt-get");
    fs::remove_file(machine.path("bin/xdotool")).unwrap();
    succeeds(&machine.setup(&[]));
    assert_eq!(machine.asked(), "apt-get update\napt-get install -y --no-install-recommends xdotool\n");
}

#[test]
fn check_installs_nothing() {
    let machine = Machine::new("ID=fedora\n");
    machine.package_manager("dnf");
    let said = fails(&machine.setup(&["--check"]));
    assert!(said.contains("Vulkan loader: missing"), "{said}");
    assert!(
        said.contains(
            "would run: dnf install -y gcc glibc-devel pkgconf-pkg-config systemd-devel alsa-lib-devel vulkan-loader"
        ),
        "{said}"
    );
    assert_eq!(machine.asked(), "");
}

#[test]
fn who_is_not_root_goes_through_sudo_or_is_told() {
    let machine = Machine::new("ID=arch\n");
    machine.package_manager("pacman");
    machine.command("id", "echo 1000");
    let said = fails(&machine.setup(&[]));
    assert!(said.contains("there is no sudo; as root run: pacman -S --needed --noconfirm gcc"), "{said}");
    assert_eq!(machine.asked(), "");

    let log = machine.path("log");
    machine.command("sudo", &format!("echo sudo >> {}; exec \"$@\"", log.display()));
    succeeds(&machine.setup(&[]));
    let asked = machine.asked();
    assert!(asked.starts_with("sudo\npacman -Sy --noconfirm\nsudo\npacman -S "), "{asked}");
}

#[test]
fn an_unknown_distribution_is_told_what_to_install() {
    let machine = Machine::new("ID=plan9\n");
    let said = fails(&machine.setup(&[]));
    assert!(said.contains("not known here; install by hand: C compiler"), "{said}");
    assert!(said.contains("still missing: "), "{said}");

    machine.furnish();
    let said = succeeds(&machine.setup(&[]));
    assert!(said.contains("everything needed is there"), "{said}");
}

#[test]
fn offline_is_no_failure_where_what_is_needed_is_there() {
    let machine = Machine::new("ID=debian\n");
    machine.furnish();
    machine.command("apt-get", "exit 100");
    fs::remove_file(machine.path("bin/Xvfb")).unwrap();
    let said = succeeds(&machine.setup(&[]));
    assert!(said.contains("offline?"), "{said}");
    assert!(said.contains("could not install xvfb"), "{said}");
    assert!(said.contains("going on without: Xvfb"), "{said}");

    fs::remove_file(machine.path("root/usr/lib/libvulkan.so.1")).unwrap();
    let said = fails(&machine.setup(&[]));
    assert!(said.contains("still missing: Vulkan loader; install it by hand"), "{said}");
}

#[test]
fn an_old_or_absent_rust_is_named() {
    let machine = Machine::new("ID=debian\n");
    machine.furnish();
    let manifest = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).unwrap();
    let wanted =
        manifest.lines().find_map(|line| line.strip_prefix("rust-version = ")).unwrap().trim_matches('"');

    for old in ["1.9.0", "1.87.9", "0.99.0"] {
        machine.command("rustc", &format!("echo 'rustc {old} (0123456 2025-01-01)'"));
        let said = fails(&machine.setup(&[]));
        assert!(
            said.contains(&format!("Rust {old} is too old: Fathomless needs {wanted} or newer")),
            "{said}"
        );
    }
    for new in [format!("{wanted}.0"), "1.100.0-nightly".to_owned(), "2.0.0".to_owned()] {
        machine.command("rustc", &format!("echo 'rustc {new} (0123456 2030-01-01)'"));
        succeeds(&machine.setup(&[]));
    }
    machine.command("rustc", "exit 1");
    assert!(fails(&machine.setup(&[])).contains("rustup default stable"));

    fs::remove_file(machine.path("bin/cargo")).unwrap();
    let said = fails(&machine.setup(&[]));
    assert!(said.contains(&format!("cargo not found; install Rust {wanted} or newer")), "{said}");

    fs::create_dir_all(machine.path(".cargo/bin")).unwrap();
    symlink(real("env"), machine.path(".cargo/bin/cargo")).unwrap();
    let said = fails(&machine.setup(&[]));
    assert!(said.contains("not on the PATH"), "{said}");
}
