// Drivers that abort, hang or crash must not take the program along. Each test
// starts a program of its own, since a process loads its drivers once.
#include "palpate/compute/cache_folder.hpp"
#include "palpate/testing/support.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace fs = std::filesystem;
using palpate::testing::program_folder;
using palpate::testing::ProgramResult;
using palpate::testing::run_program;
using palpate::testing::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

namespace {

class Drivers : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(vendors());
    probe_ = (program_folder() / "palpate-probe").string();
  }
  fs::path vendors() const { return folder_ / "vendors"; }
  fs::path cache() const { return folder_ / "cache"; }

  void add(const std::string& fault, const std::string& name) const {
    add_library((program_folder() / "fakes" / ("fake_icd_" + fault + ".so")).string(), name);
  }
  void add_library(const std::string& library, const std::string& name) const {
    std::ofstream(vendors() / name) << library << "\n";
  }
  /// The real driver of this machine, if it has one.
  bool add_real(const std::string& name) const {
    std::ifstream icd("/etc/OpenCL/vendors/pocl.icd");
    std::string library;
    if (!std::getline(icd, library)) return false;
    add_library(library, name);
    return true;
  }
  ProgramResult run(std::vector<std::string> environment = {}) const {
    std::vector<std::string> words{"-u",
                                   "PALPATE_DEVICE",
                                   "-u",
                                   "OCL_ICD_FILENAMES",
                                   "OCL_ICD_VENDORS=" + vendors().string() + "/",
                                   "PALPATE_CACHE_DIR=" + cache().string(),
                                   "PALPATE_PROBE=" + probe_,
                                   "TMPDIR=" + folder_.path().string()};
    words.insert(words.end(), environment.begin(), environment.end());
    words.push_back((program_folder() / "device_probe").string());
    return run_program("/usr/bin/env", words);
  }
  /// A probe that leaves a line in `count_file` whenever it is started.
  void count_probes() {
    const fs::path script = folder_ / "counting";
    std::ofstream(script) << "#!/bin/sh\necho started >> '" << count_file().string() << "'\nexec '" << probe_
                          << "' \"$@\"\n";
    fs::permissions(script, fs::perms::owner_all);
    probe_ = script.string();
  }
  fs::path count_file() const { return folder_ / "count"; }
  int probes_started() const {
    std::ifstream file(count_file());
    int lines = 0;
    for (std::string line; std::getline(file, line);) ++lines;
    return lines;
  }
  std::vector<fs::path> remembered() const {
    std::vector<fs::path> files;
    if (fs::exists(cache() / "drivers"))
      for (const auto& entry : fs::directory_iterator(cache() / "drivers")) files.push_back(entry.path());
    return files;
  }

  TemporaryFolder folder_;
  std::string probe_;
};

class BadDrivers : public Drivers, public ::testing::WithParamInterface<const char*> {};

TEST_P(BadDrivers, AreNamedAndLeftOutWhileTheOthersGoOn) {
  add(GetParam(), "a-bad.icd");
  const std::string fault = GetParam();
  // Where the time limit is short, a good driver on a busy machine may miss it.
  const bool real = fault != "hang" && add_real("b-good.icd");
  const auto result = run({fault == "hang" ? "PALPATE_PROBE_TIME_LIMIT_S=2" : "UNUSED=1"});
  EXPECT_EQ(result.signal, 0) << "the driver took the program along";
  EXPECT_THAT(result.out, AllOf(HasSubstr("a-bad.icd"), HasSubstr("unusable"), HasSubstr("left out")));
  // A sanitizer, where there is one, takes the signal and ends the program itself.
  const char* end = fault == "hang" ? "did not answer" : fault == "exit" ? "exit code 7" : "SIGABRT";
  if (fault == "crash")
    EXPECT_THAT(result.out, ::testing::AnyOf(HasSubstr("SIGSEGV"), HasSubstr("exit code")));
  else
    EXPECT_THAT(result.out, HasSubstr(end));
  if (!real) return;
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.out, HasSubstr("opened 0"));
}

INSTANTIATE_TEST_SUITE_P(Faults, BadDrivers,
                         ::testing::Values("abort_at_load", "abort", "crash", "exit", "hang"),
                         [](const auto& fault) { return std::string(fault.param); });

TEST_F(Drivers, ABadOneAloneIsNoDeviceAndOpeningSaysWhy) {
  add("abort", "only.icd");
  const auto result = run();
  EXPECT_EQ(result.signal, 0);
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.error,
              AllOf(HasSubstr("only.icd"), HasSubstr("SIGABRT"), HasSubstr("Update or remove")));
}

TEST_F(Drivers, AreTriedOnceAndAgainWhenSomethingThatCanBeSeenHasChanged) {
  count_probes();
  add("none", "one.icd");
  EXPECT_EQ(run().signal, 0);
  EXPECT_EQ(probes_started(), 1);
  EXPECT_EQ(run().signal, 0);
  EXPECT_EQ(probes_started(), 1) << "what is remembered needs no child";
  EXPECT_EQ(run({"POCL_DEVICES=basic"}).signal, 0);
  EXPECT_EQ(probes_started(), 2) << "another setting of a driver";
  add("none", "two.icd");
  EXPECT_EQ(run().signal, 0);
  EXPECT_EQ(probes_started(), 3) << "another driver";
  // The same name, another library behind it, as an update leaves it.
  fs::copy_file(program_folder() / "fakes" / "fake_icd_none.so", folder_ / "changing.so");
  std::ofstream(vendors() / "two.icd") << (folder_ / "changing.so").string() << "\n";
  EXPECT_EQ(run().signal, 0);
  const int before = probes_started();
  fs::last_write_time(folder_ / "changing.so", fs::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(run().signal, 0);
  EXPECT_EQ(probes_started(), before + 1) << "a new library";
}

TEST_F(Drivers, ADamagedMemoryIsNoMemory) {
  count_probes();
  add("abort", "bad.icd");
  run();
  const int tried = probes_started();
  ASSERT_EQ(remembered().size(), 1U);
  std::ofstream(remembered().front(), std::ios::binary | std::ios::app) << "x";
  const auto again = run();
  EXPECT_EQ(again.signal, 0);
  EXPECT_EQ(probes_started(), 2 * tried);
  EXPECT_THAT(again.out, HasSubstr("bad.icd"));
  EXPECT_TRUE(palpate::compute::read_cached(remembered().front())) << "it is written anew";
}

TEST_F(Drivers, AFolderThatCannotBeWrittenIsNoError) {
  add("abort", "bad.icd");
  std::ofstream(cache()) << "a file where the folder should be";
  const auto result = run();
  EXPECT_EQ(result.signal, 0);
  EXPECT_THAT(result.out, HasSubstr("SIGABRT"));
}

TEST_F(Drivers, WithoutTheProbeProgramTheyAreLoadedAsTheyAre) {
  add("none", "harmless.icd");
  probe_ = (folder_ / "nowhere").string();
  EXPECT_EQ(run().exit_code, 4);
  EXPECT_TRUE(remembered().empty());
  probe_ = "off";
  EXPECT_EQ(run().exit_code, 4);
  EXPECT_TRUE(remembered().empty());
}

TEST_F(Drivers, WithoutATemporaryFolderABadOneStaysOutAndNothingIsRemembered) {
  add("abort_at_load", "a-bad.icd");
  add("none", "b-good.icd");
  const auto result = run({"TMPDIR=" + (folder_ / "missing").string()});
  EXPECT_EQ(result.signal, 0) << "the driver took the program along";
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.out + result.error, HasSubstr("TMPDIR"));
  EXPECT_TRUE(remembered().empty());
}

TEST_F(Drivers, NothingIsLeftInTheTemporaryFolder) {
  add("abort", "bad.icd");
  add("none", "good.icd");
  run();
  for (const auto& entry : fs::directory_iterator(folder_.path()))
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr("palpate-drivers")));
}

}  // namespace
