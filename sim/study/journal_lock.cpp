#include "sim/study/journal_lock.h"

#include <cerrno>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "sim/files/output_failure.h"

namespace abbe::sim::study {
namespace {

[[noreturn]] void not_locked(const std::filesystem::path& file, int reason) {
  throw OutputFailure(
      fmt::format("{}: cannot be locked: {}", file.string(), std::strerror(reason)));
}

/// Who holds the lock, as that process wrote it.
std::string holder(int descriptor) {
  char text[200];
  const ssize_t length = ::pread(descriptor, text, sizeof text, 0);
  return length > 0 ? std::string(text, std::size_t(length)) : "another process";
}

/// Whether a lock may be made of a file: an empty one, or what a holder left.
bool is_lock(int descriptor) {
  struct stat about {};
  if (::fstat(descriptor, &about) != 0 || !S_ISREG(about.st_mode)) return false;
  const std::string who = about.st_size > 0 ? holder(descriptor) : "";
  return about.st_size == 0 ||
         (about.st_size < 200 && who.starts_with("process ") && who.find(" on ") != who.npos);
}

}  // namespace

JournalLock::JournalLock(const std::filesystem::path& journal)
    : journal_(journal), file_(journal.string() + "-lock") {
  while (descriptor_ < 0) try_once();
  char host[100] = "";
  ::gethostname(host, sizeof host - 1);
  const std::string who = fmt::format("process {} on {}", ::getpid(), host);
  // only to inform others: on a full disk it may fail
  if (::ftruncate(descriptor_, 0) == 0) [[maybe_unused]]
    const ssize_t written = ::pwrite(descriptor_, who.data(), who.size(), 0);
}

JournalLock::~JournalLock() {
  ::unlink(file_.c_str());
  ::close(descriptor_);
}

void JournalLock::try_once() {
  const int descriptor = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (descriptor < 0) not_locked(file_, errno);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    const int reason = errno;
    const std::string who = holder(descriptor);
    ::close(descriptor);
    if (reason == EINTR) return;
    if (reason != EWOULDBLOCK) not_locked(file_, reason);
    throw OutputFailure(fmt::format(
        "{}: another process works on this study ({}); wait for it, or use another --out",
        journal_.string(), who));
  }
  if (!is_lock(descriptor)) {
    ::close(descriptor);
    throw OutputFailure(fmt::format(
        "{}: a file that abbe did not make stands there; move it, or choose another --out",
        file_.string()));
  }
  // its holder may have ended, and the file with it, between the two calls above
  struct stat held {
  }, there{};
  if (::fstat(descriptor, &held) == 0 && ::stat(file_.c_str(), &there) == 0 &&
      held.st_ino == there.st_ino && held.st_dev == there.st_dev)
    descriptor_ = descriptor;
  else
    ::close(descriptor);
}

}  // namespace abbe::sim::study
