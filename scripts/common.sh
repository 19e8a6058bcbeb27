# shellcheck shell=bash
# What the scripts of this folder share; sourced, not run.

# The repository's root: every script runs from there.
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Says what is wrong and what to do, and ends: fail MESSAGE [HINT].
fail() {
    printf 'error: %s\n' "$1" >&2
    [ $# -lt 2 ] || printf 'hint: %s\n' "$2" >&2
    exit 1
}

step() { printf '== %s\n' "$*" >&2; }

# The comment at the head of the calling script is its help.
usage() { sed -n '2,/^[^#]/{s/^# \{0,1\}//p;}' "$0"; }

# An option's value: value OPTION "${2-}".
value() {
    [ -n "$2" ] || fail "$1 wants a value" "--help shows the options"
    printf '%s\n' "$2"
}

need() {
    command -v "$1" >/dev/null 2>&1 || fail "$1 is not there" "$2"
}

# The version that all crates share.
workspace_version() {
    sed -n '/^\[workspace\.package\]/,/^\[/s/^version = "\(.*\)"$/\1/p' "$root/Cargo.toml"
}

host_target() {
    need rustc "install Rust: https://rustup.rs"
    rustc -vV | sed -n 's/^host: //p'
}
