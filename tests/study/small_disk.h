#pragma once

#include <sys/mount.h>
#include "tests/test.h"

namespace abbe::sim::study {

/// A small disk of its own, where one may mount it.
struct SmallDisk {
  /// @param size  "400k"
  SmallDisk(fs::path at, const std::string& size) : path(std::move(at)) {
    mounted = ::mount("tmpfs", path.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted) ::umount2(path.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool resize(const std::string& size) const {
    return ::mount("tmpfs", path.c_str(), "tmpfs", MS_REMOUNT, ("size=" + size).c_str()) == 0;
  }

  fs::path path;
  bool mounted = false;
};

}  // namespace abbe::sim::study
