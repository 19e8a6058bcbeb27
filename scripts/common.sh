# shellcheck shell=bash
# Functions that the scripts of this folder share; sourced, not run.

# The repository's root: every script runs from there.
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Prints an error and a hint, and exits: fail MESSAGE [HINT].
fail() {
    printf 'error: %s\n' "$1" >&2
    [ $# -lt 2 ] || printf 'hint: %s\n' "$2" >&2
    exit 1
}

step() { printf '== %s\n' "$*" >&2; }

# Prints the comment at the head of the calling script as its help.
usage() { sed -n '2,/^[^#]/{s/^# \{0,1\}//p;}' "$0"; }

# Prints an option's value: value OPTION "${2-}".
value() {
    [ -n "$2" ] || fail "$1 needs a value" "--help shows the options"
    printf '%s\n' "$2"
}

need() {
    command -v "$1" >/dev/null 2>&1 || fail "$1 is not installed" "$2"
}

# The version that all crates share.
workspace_version() {
    sed -n '/^\[workspace\.package\]/,/^\[/s/^version = "\(.*\)"$/\1/p' "$root/Cargo.toml"
}

host_target() {
    need rustc "install Rust: https://rustup.rs"
    rustc -vV | sed -n 's/^host: //p'
}
