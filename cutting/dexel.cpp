#include "cutting/dexel.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace abbe::cutting {

DexelLine::DexelLine(const DexelLine& other) : count_(other.count_), one_{} {
  if (count_ <= 1) {
    if (count_ == 1) one_ = *other.data();
    return;
  }
  capacity_ = count_;
  many_ = new DexelRun[capacity_];
  std::copy(other.many_, other.many_ + count_, many_);
}

DexelLine::DexelLine(DexelLine&& other) noexcept
    : count_(other.count_), capacity_(other.capacity_), one_{} {
  if (capacity_ == 0)
    one_ = other.one_;
  else
    many_ = std::exchange(other.many_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
}

DexelLine& DexelLine::operator=(DexelLine other) noexcept {
  drop();
  count_ = other.count_;
  capacity_ = other.capacity_;
  if (capacity_ == 0)
    one_ = other.one_;
  else
    many_ = std::exchange(other.many_, nullptr);
  other.count_ = 0;
  other.capacity_ = 0;
  return *this;
}

void DexelLine::drop() {
  if (capacity_ > 0) delete[] many_;
  capacity_ = 0;
  count_ = 0;
}

double DexelLine::length() const {
  double sum = 0.0;
  for (const DexelRun& run : runs()) sum += run.high - run.low;
  return sum;
}

double DexelLine::length(double low, double high) const {
  double sum = 0.0;
  for (const DexelRun& run : runs())
    sum += std::max(0.0, std::min(run.high, high) - std::max(run.low, low));
  return sum;
}

double DexelLine::inside_by(double at) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const DexelRun& run : runs()) most = std::max(most, std::min(at - run.low, run.high - at));
  return most;
}

void DexelLine::insert(std::uint32_t place, const DexelRun& run) {
  if (count_ == (capacity_ == 0 ? 1u : capacity_)) {
    const std::uint32_t more = std::max(2u, count_ + count_ / 2);
    auto* runs = new DexelRun[more];
    std::copy(data(), data() + count_, runs);
    if (capacity_ > 0) delete[] many_;
    many_ = runs;
    capacity_ = more;
  }
  DexelRun* const runs = data();
  std::copy_backward(runs + place, runs + count_, runs + count_ + 1);
  runs[place] = run;
  ++count_;
}

void DexelLine::erase(std::uint32_t place) {
  DexelRun* const runs = data();
  std::copy(runs + place + 1, runs + count_, runs + place);
  --count_;
}

void DexelLine::append(const DexelRun& run) {
  if (!(run.high - run.low > touch)) return;
  if (count_ > 0 && run.low <= data()[count_ - 1].high + touch) {
    DexelRun& last = data()[count_ - 1];
    if (run.high <= last.high) return;
    last.high = run.high;
    last.high_line = run.high_line;
    return;
  }
  insert(count_, run);
}

double DexelLine::take(double low, double high, std::int32_t line) {
  double taken = 0.0;
  for (std::uint32_t i = 0; i < count_;) {
    DexelRun& run = data()[i];
    if (run.low >= high - touch) break;
    if (run.high <= low + touch) {
      ++i;
      continue;
    }
    const bool keeps_low = low > run.low + touch;
    const bool keeps_high = high < run.high - touch;
    if (keeps_low && keeps_high) {
      const DexelRun upper{high, run.high, line, run.high_line};
      run.high = low;
      run.high_line = line;
      insert(i + 1, upper);
      return taken + (high - low);
    }
    if (keeps_low) {
      taken += run.high - low;
      run.high = low;
      run.high_line = line;
      ++i;
    } else if (keeps_high) {
      taken += high - run.low;
      run.low = high;
      run.low_line = line;
      break;
    } else {
      taken += run.high - run.low;
      erase(i);
    }
  }
  return taken;
}

}  // namespace abbe::cutting
