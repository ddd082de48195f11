# SPDX-License-Identifier: BSD-3-Clause
# shellcheck shell=bash
# Sourced by tools/ci.sh: makes a fresh minimal Debian 12 in a folder, runs the steps in it, and removes it.
#
# Package sources, proxies, certificates and index settings are read from this machine at run time. All mounts are made
# in a mount namespace and all programs run in a process namespace of their own. Both end with their first process, so
# no process keeps running and no mount remains under the folder that is deleted.

SUITE=bookworm
NEEDED_GB=8         # 6 GB with a built workspace and its test results
GUEST=guest
HOME_INSIDE=/home/$GUEST
HANDED_CA=/etc/ssl/handed-in-ca.crt

progress() {
    printf '\n[%s] %s\n' "$(date -u +%H:%M:%S)" "$*"
}

# Prints why no fresh root can be made here, or nothing. Installs mmdebstrap if it is missing.
why_no_fresh_root() {
    local folder free
    folder=$(root_folder)
    if [ "${CI_ROOT:-}" = host ]; then
        echo "CI_ROOT=host asks for this machine"
    elif ! (detect_platform && [ "$PLATFORM" = debian12 ]) 2>/dev/null; then
        echo "only Debian 12 can make one, from its own package sources"
    elif [ "$(id -u)" -ne 0 ] && ! sudo -n true 2>/dev/null; then
        echo "this is neither root nor a user whose sudo asks for no password"
    elif ! rooted unshare --mount --pid --fork --mount-proc --uts --ipc -- mount -t tmpfs none /mnt 2>/dev/null; then
        echo "this kernel or container does not permit mount and process namespaces"
    elif free=$(df --output=avail -BG "$folder" | tail -n 1 | tr -dc '0-9') && [ "$free" -lt "$NEEDED_GB" ]; then
        echo "only $free GB are free in $folder, it takes $NEEDED_GB (another folder: CI_FOLDER)"
    elif ! command -v mmdebstrap >/dev/null && ! install_mmdebstrap; then
        echo "mmdebstrap is not installed and apt-get cannot install it"
    elif [ -z "$(debian_sources)" ]; then
        echo "apt has no package lists of Debian $SUITE (apt-get update makes them)"
    fi
}

root_folder() {
    printf '%s' "${CI_FOLDER:-${TMPDIR:-/var/tmp}}"
}

rooted() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    else
        sudo -n -- "$@"
    fi
}

install_mmdebstrap() {
    rooted env DEBIAN_FRONTEND=noninteractive sh -c 'apt-get -q update &&
        apt-get -q install -y --no-install-recommends mmdebstrap' >&2
}

# The package sources of Debian itself that apt uses here, one `deb` line each. Sources of other vendors are excluded.
debian_sources() {
    if ! apt_targets | grep -q .; then
        rooted apt-get -q update >&2
    fi
    apt_targets
}

apt_targets() {
    # shellcheck disable=SC2016  # apt expands the variables
    apt-get indextargets --format '$(ORIGIN)|deb $(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
        sed -n "s/^Debian|\(deb [^ ]* $SUITE\(-[a-z-]*\)\? \)/\1/p" | sort -u
}

# apt's settings about how to fetch: proxies, certificates, dates. Settings that name a program or only this machine are excluded.
apt_settings() {
    apt-config dump --no-empty Acquire |
        grep -v -e '^Acquire::IndexTargets' -e '^Acquire::cdrom' -e '^Acquire::Changelogs' -e '[Aa]uto-\?[Dd]etect'
    local scheme proxy
    for scheme in http https; do
        proxy=${scheme}_proxy
        if [ -n "${!proxy:-}" ] && ! apt-config dump Acquire::$scheme::Proxy | grep -q '"..*"'; then
            printf 'Acquire::%s::Proxy "%s";\n' "$scheme" "${!proxy}"
        fi
    done
}

# pip's settings files of this machine and user.
pip_files() {
    local file
    for file in /etc/pip.conf "$HOME/.pip/pip.conf" "${XDG_CONFIG_HOME:-$HOME/.config}/pip/pip.conf" \
            "${PIP_CONFIG_FILE:-}"; do
        if [ -n "$file" ] && [ -r "$file" ]; then
            printf '%s\n' "$file"
        fi
    done
}

# Reads settings, prints the absolute paths of existing files that they name.
named_paths() {
    local word
    tr -s "[:space:]=\"',;" '\n' | sed -n -e 's#^file://\(localhost\)\?/#/#' -e 's#^file:/#/#' -e '/^\//p' | sort -u |
        while read -r word; do
            if [ "$word" != / ] && [ -e "$word" ]; then
                printf '%s\n' "$word"
            fi
        done
}

# Variables passed to the steps: those of the Makefile, proxies, and pip's.
handed_variables() {
    local name
    for name in CI CI_STEPS DEMO_ARGS TEST_JOBS TEST_TIMEOUT TEST_PACKAGES http_proxy https_proxy no_proxy HTTP_PROXY \
            HTTPS_PROXY NO_PROXY $(compgen -e PIP_); do
        if [ -n "${!name:-}" ] && [ "$name" != PIP_CONFIG_FILE ] && [ "$name" != PIP_CERT ]; then
            printf '%s=%s\n' "$name" "${!name}"
        fi
    done
    if [ -n "$(certificates)" ]; then
        printf 'PIP_CERT=%s\n' "$HANDED_CA"
    fi
}

# The file of certificates that the settings of this machine name, if they name any.
certificates() {
    local file
    for file in "${PIP_CERT:-}" "$(pip_files | xargs -r sed -n 's/^ *cert *= *//p' | tail -n 1)" \
            "${REQUESTS_CA_BUNDLE:-}" "${SSL_CERT_FILE:-}"; do
        if [ -n "$file" ] && [ -r "$file" ]; then
            printf '%s' "$file"
            return
        fi
    done
}

# Writes the settings to FOLDER: sources.list, apt.conf, environment, binds (paths to mount), tree/ (files to copy).
prepare() {
    local work=$1 file path tree=$1/tree
    mkdir -p "$tree/etc/apt/trusted.gpg.d" "$tree/etc/ssl" "$tree/usr/local/share"
    debian_sources > "$work/sources.list"
    apt_settings > "$work/apt.conf"
    handed_variables > "$work/environment"
    named_paths < "$work/sources.list" > "$work/binds"
    for file in /etc/apt/auth.conf /etc/apt/auth.conf.d /etc/apt/preferences /etc/apt/preferences.d /etc/hosts /etc/resolv.conf \
            /usr/local/share/ca-certificates; do
        [ ! -e "$file" ] || cp -rL --preserve=mode "$file" "$tree$(dirname "$file")/"
    done
    # Debian's own keys come with its packages
    for file in /etc/apt/trusted.gpg.d/* /etc/apt/keyrings/*; do
        if [ -f "$file" ] && [[ $file != */debian-archive-* ]]; then
            cp -L "$file" "$tree/etc/apt/trusted.gpg.d/"
        fi
    done
    file=$(certificates)
    [ -z "$file" ] || cp -L "$file" "$tree$HANDED_CA"
    for path in $(named_paths < "$work/apt.conf"); do
        [ ! -f "$path" ] || install -D "$path" "$tree$path"
    done
    # in the order of pip: repeated sections are merged by name
    while read -r file; do
        cat "$file"
        echo
    done < <(pip_files) > "$work/pip.conf"
    merge_sections < "$work/pip.conf" > "$tree/etc/pip.conf"
    # a local index names its archives relative to its folder `simple`
    { cat "$work/pip.conf" "$work/environment"; } | named_paths | while read -r path; do
        [ ! -d "$path" ] || printf '%s\n' "${path%/simple}"
    done >> "$work/binds"
}

# Joins settings files: for a repeated key of a section the last value counts; a parser refuses a second section.
merge_sections() {
    awk '
        /^[ \t]*[#;]/ || /^[ \t]*$/ { next }
        /^\[/ { section = $0; if (!(section in seen)) { seen[section] = 1; order[++sections] = section } next }
        /^[ \t]/ { value[section, key] = value[section, key] "\n" $0; next }
        {
            key = $0; sub(/[ \t]*[=:].*/, "", key)
            if (!((section, key) in value)) keys[section] = keys[section] "\n" key
            value[section, key] = $0
        }
        END {
            for (i = 1; i <= sections; i++) {
                print order[i]
                n = split(keys[order[i]], names, "\n")
                for (j = 2; j <= n; j++) print value[order[i], names[j]]
            }
        }'
}

# Removes the folders of killed runs: no process holds their lock.
remove_stale_roots() {
    local folder
    for folder in "$(root_folder)"/m2wr-root.*/; do
        if [ -e "$folder/lock" ] && rooted flock --nonblock "$folder/lock" true; then
            remove_root "${folder%/}"
        fi
    done
}

remove_root() {
    if grep -q -F " $1/" /proc/self/mountinfo; then
        printf 'WARNING: %s is not removed: something is mounted below it\n' "$1" >&2
        return 1
    fi
    rooted rm -rf --one-file-system "$1"
}

# Makes the root, runs the set-up as a new user and then the steps in it; returns the exit code of the failed step.
run_in_fresh_root() {
    local work limit=${CI_LIMIT:-5100} runner status=0 interrupted=
    remove_stale_roots
    work=$(mktemp -d "$(root_folder)/m2wr-root.XXXXXX")
    prepare "$work"
    progress "fresh root: Debian $SUITE in $work, from this machine's package sources"
    exec 9> "$work/lock"
    flock 9
    rooted setpriv --pdeathsig KILL -- unshare --mount --pid --fork --kill-child --mount-proc --uts --ipc --propagation private -- \
        "$WORKSPACE/tools/ci.sh" --inside "$work" &
    runner=$!
    trap 'interrupted=130' INT
    trap 'interrupted=143' TERM HUP
    while [ -z "$interrupted" ] && [ "$SECONDS" -lt "$limit" ] && kill -0 "$runner" 2>/dev/null; do
        sleep 1
    done
    if kill -0 "$runner" 2>/dev/null; then
        kill -KILL "$runner"
        if [ -n "$interrupted" ]; then
            progress "fresh root: ended by a signal"
        else
            progress "fresh root: ended after CI_LIMIT=$limit s"
        fi
        status=${interrupted:-124}
        wait "$runner" 2>/dev/null || true
    else
        wait "$runner" || status=$?
    fi
    fetch_results "$work/root$HOME_INSIDE/m2wr_ws"
    progress "fresh root: removing $work"
    remove_root "$work" || true
    trap - INT TERM HUP
    return "$status"
}

# Copies results, logs and pictures of the run to this checkout, as its owner's files.
fetch_results() {
    local name
    for name in test_results demo_output; do
        if [ -d "$1/$name" ]; then
            rm -rf "${WORKSPACE:?}/$name"
            rooted cp -r --no-preserve=ownership "$1/$name" "$WORKSPACE/"
            rooted chown -R "$(stat -c %u:%g "$WORKSPACE")" "$WORKSPACE/$name"
        fi
    done
}

# The rest runs in the namespaces, as their first process; WORK is the folder written by `prepare`.
inside() {
    local work=$1
    local root=$work/root
    mkdir "$root"
    chmod 755 "$root"
    # for file systems that forbid set-uid programs and devices
    mount --bind "$root" "$root"
    mount -o remount,bind,dev,suid,exec "$root"
    bootstrap "$work" "$root"
    mount_system "$work" "$root"
    copy_checkout "$root$HOME_INSIDE/m2wr_ws"
    chroot "$root" chown -R "$GUEST:$GUEST" "$HOME_INSIDE/m2wr_ws"
    progress "fresh root: ${STEPS[0]} by a user with sudo"
    enter "$work" "$root" "$GUEST" make "${STEPS[0]}"
    chroot "$root" chown -R root:root "$HOME_INSIDE/m2wr_ws"
    enter "$work" "$root" root tools/ci.sh --steps
}

bootstrap() {
    local work=$1 root=$2 hooks=()
    if grep -q ' file:' "$work/sources.list"; then
        hooks=(--hook-dir=/usr/share/mmdebstrap/hooks/file-mirror-automount)
    fi
    # shellcheck disable=SC2016  # mmdebstrap runs the hook with the root as $1
    mmdebstrap --mode=root --variant=minbase --include=make,git,sudo --aptopt="$work/apt.conf" "${hooks[@]}" \
        --setup-hook="cp -r --preserve=mode '$work/tree/.'"' "$1"' \
        --dpkgopt=force-unsafe-io "$SUITE" "$root" "$work/sources.list"
    cp -r --preserve=mode "$work/tree/." "$root/"
    if [ -e "$root$HANDED_CA" ]; then
        printf 'Acquire::https::CaInfo "%s";\n' "$HANDED_CA" > "$root/etc/apt/apt.conf.d/99handed-in-ca"
    fi
    # no services are started, as in a container
    printf '#!/bin/sh\nexit 101\n' > "$root/usr/sbin/policy-rc.d"
    chmod 755 "$root/usr/sbin/policy-rc.d"
    hostname fresh
    printf '127.0.1.1 fresh\n' >> "$root/etc/hosts"
    chroot "$root" useradd --create-home --shell /bin/bash "$GUEST"
    printf '%s ALL=(ALL) NOPASSWD: ALL\n' "$GUEST" > "$root/etc/sudoers.d/$GUEST"
    progress "fresh root: made, $(du -sm "$root" | cut -f1) MB"
}

mount_system() {
    local work=$1 root=$2 path
    mount -t proc proc "$root/proc"
    mount -t sysfs -o ro sysfs "$root/sys" 2>/dev/null || true
    mount -t tmpfs -o mode=755,nosuid tmpfs "$root/dev"
    for path in null zero full random urandom tty; do
        : > "$root/dev/$path"
        mount --bind "/dev/$path" "$root/dev/$path"
    done
    ln -s /proc/self/fd "$root/dev/fd"
    ln -s fd/0 "$root/dev/stdin"
    ln -s fd/1 "$root/dev/stdout"
    ln -s fd/2 "$root/dev/stderr"
    mkdir "$root/dev/pts" "$root/dev/shm"
    mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts "$root/dev/pts"
    ln -s pts/ptmx "$root/dev/ptmx"
    mount -t tmpfs -o mode=1777,nosuid,nodev tmpfs "$root/dev/shm"
    while read -r path; do
        read_only "$path" "$root$path"
    done < "$work/binds"
    # test data next to the checkout is mounted at the same relative path
    if [ -d "$WORKSPACE/../shared" ]; then
        read_only "$WORKSPACE/../shared" "$root$HOME_INSIDE/shared"
    fi
}

read_only() {
    if [ -d "$1" ]; then
        mkdir -p "$2"
    else
        mkdir -p "$(dirname "$2")"
        : > "$2"
    fi
    mount --bind "$1" "$2"
    mount -o remount,bind,ro "$2"
}

# Copies the sources: files that git tracks or does not ignore; without git all files except those of builds.
copy_checkout() {
    local git=(git -c "safe.directory=$WORKSPACE" -C "$WORKSPACE")
    mkdir -p "$1"
    if "${git[@]}" rev-parse --is-inside-work-tree >/dev/null 2>&1; then
        "${git[@]}" ls-files -z --cached --others --exclude-standard |
            (cd "$WORKSPACE" && while IFS= read -r -d '' file; do
                if [ -e "$file" ] || [ -L "$file" ]; then
                    printf '%s\0' "$file"
                fi
            done) | tar -C "$WORKSPACE" --null --files-from=- -cf - | tar -C "$1" --no-same-owner -xf -
    else
        tar -C "$WORKSPACE" --exclude=./build --exclude=./catkin_build --exclude=./devel --exclude=./install \
            --exclude=./logs --exclude='./.venv*' --exclude=__pycache__ -cf - . | tar -C "$1" --no-same-owner -xf -
    fi
}

# Runs a command in the checkout inside, as a user with the environment of a new login.
enter() {
    local work=$1 root=$2 user=$3 home
    shift 3
    mapfile -t handed < "$work/environment"
    home=$(chroot "$root" getent passwd "$user" | cut -d: -f6)
    chroot "$root" /usr/bin/env -i --chdir="$HOME_INSIDE/m2wr_ws" HOME="$home" USER="$user" LOGNAME="$user" SHELL=/bin/bash \
        TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "${handed[@]}" \
        setpriv --reuid="$user" --regid="$user" --init-groups -- "$@"
}
