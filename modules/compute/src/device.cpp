#include "palpate/compute/device.hpp"

#include "drivers.hpp"
#include "enumerate.hpp"

#include "palpate/core/error.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace palpate::compute {

namespace {

int rank(DeviceType type) {
  switch (type) {
    case DeviceType::gpu:
      return 0;
    case DeviceType::cpu:
      return 1;
    default:
      return 2;
  }
}

bool is_better(const DeviceInfo& a, const DeviceInfo& b) {
  if (rank(a.type) != rank(b.type)) return rank(a.type) < rank(b.type);
  return a.memory_bytes > b.memory_bytes;  // on a tie the first stays
}

void choose_default(std::vector<Found>& found) {
  Found* best = nullptr;
  std::size_t usable = 0;
  for (auto& candidate : found) {
    if (!candidate.info.usable) continue;
    ++usable;
    if (best == nullptr || is_better(candidate.info, best->info)) best = &candidate;
  }
  if (best == nullptr) return;
  best->info.is_default = true;
  best->info.reason =
      usable == 1 ? "the only usable device" : "first of GPU, CPU, others; then the most memory";
  for (auto& other : found) {
    if (!other.info.usable || other.info.is_default) continue;
    const bool by_type = rank(other.info.type) != rank(best->info.type);
    other.info.reason =
        "device " + std::to_string(best->info.index) + " comes before it: " +
        (by_type ? "it is a " + to_string(best->info.type) : "it has at least as much memory");
  }
}

/// What drivers that are left out would have been: named, never usable.
Found left_out(const BadDriver& driver) {
  Found found;
  found.info.name = driver.file.label;
  found.info.platform = driver.file.library;
  found.info.driver = "not loaded";
  found.info.usable = false;
  found.info.reason = driver.reason;
  return found;
}

std::vector<Found> find_devices() {
  const Screening& screening = screened_drivers();
  std::vector<Found> found = enumerate();
  for (const auto& failing : screening.devices) {
    int twin = 0;
    for (Found& entry : found) {
      const bool same = entry.info.platform == failing.platform && entry.info.name == failing.name &&
                        entry.info.driver == failing.driver;
      if (!same || twin++ != failing.twin) continue;
      entry.info.usable = false;
      entry.info.reason = failing.reason;
    }
  }
  for (const auto& driver : screening.drivers) {
    found.push_back(left_out(driver));
    found.back().info.index = static_cast<int>(found.size()) - 1;
  }
  choose_default(found);
  return found;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// The environment's choice where the caller has none.
std::string effective(const std::string& selector) {
  if (!selector.empty()) return selector;
  const char* from_environment = std::getenv("PALPATE_DEVICE");
  return from_environment == nullptr ? std::string() : std::string(from_environment);
}

bool matches(const DeviceInfo& info, const std::string& wanted) {
  if (wanted.empty()) return info.is_default;
  if (std::all_of(wanted.begin(), wanted.end(), [](unsigned char c) { return std::isdigit(c) != 0; }))
    return std::to_string(info.index) == wanted;
  return lower(info.name + " " + info.platform).find(lower(wanted)) != std::string::npos;
}

/// A part of a name may fit several devices: a usable one comes first, the
/// default before others.
const Found* select(const std::vector<Found>& found, const std::string& wanted) {
  const auto merit = [](const Found& f) { return (f.info.usable ? 2 : 0) + (f.info.is_default ? 1 : 0); };
  const Found* chosen = nullptr;
  for (const auto& candidate : found)
    if (matches(candidate.info, wanted) && (chosen == nullptr || merit(candidate) > merit(*chosen)))
      chosen = &candidate;
  return chosen;
}

[[noreturn]] void throw_no_device(const std::string& text) {
  throw core::Error(core::ErrorKind::device, "no-device", text);
}

std::string names_of(const std::vector<Found>& found) {
  std::string names;
  for (const auto& entry : found)
    names += (names.empty() ? "" : "; ") + std::to_string(entry.info.index) + ": " + entry.info.name + " (" +
             entry.info.platform + ")";
  return names;
}

}  // namespace

std::string to_string(DeviceType type) {
  switch (type) {
    case DeviceType::cpu:
      return "cpu";
    case DeviceType::gpu:
      return "gpu";
    case DeviceType::accelerator:
      return "accelerator";
    default:
      return "other";
  }
}

std::vector<DeviceInfo> list_devices() {
  std::vector<DeviceInfo> infos;
  for (auto& entry : find_devices()) infos.push_back(std::move(entry.info));
  return infos;
}

const DeviceInfo& Device::info() const noexcept { return impl_->info; }

void Device::finish() const { check_at_work(clFinish(impl_->queue.get()), "clFinish", "its queue", *this); }

void Device::flush() const { check_at_work(clFlush(impl_->queue.get()), "clFlush", "its queue", *this); }

Device open_device(const std::string& selector) {
  const auto found = find_devices();
  if (found.empty())
    throw_no_device(
        "No OpenCL device was found. Install a driver (on Debian: apt install pocl-opencl-icd runs on any "
        "processor), or choose the device \"reference\", which needs none and is slow.");
  const std::string wanted = effective(selector);
  const Found* chosen = select(found, wanted);
  if (chosen == nullptr && wanted.empty())
    throw_no_device("No usable OpenCL device: " + names_of(found) + ". " + found.front().info.name + ": " +
                    found.front().info.reason + ".");
  if (chosen == nullptr)
    throw_no_device("No OpenCL device is called \"" + wanted +
                    "\". The devices by index: " + names_of(found) + ".");
  if (!chosen->info.usable)
    throw_no_device(chosen->info.name + " cannot be used: " + chosen->info.reason +
                    ". The devices by index: " + names_of(found) + ".");
  return open_found(*chosen);
}

bool is_reference_selector(const std::string& selector) { return lower(effective(selector)) == "reference"; }

}  // namespace palpate::compute
