// Whatever the reader process does, the caller gets a volume or an Error, and no process stays behind.
#include "reader_files.hpp"

#include "palpate/core/error.hpp"
#include "palpate/imaging/reader.hpp"
#include "palpate/testing/support.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <signal.h>
#include <sys/wait.h>
#include <thread>

namespace {

using palpate::core::Error;
using palpate::imaging::read;
using palpate::imaging::ReaderLimits;
using namespace palpate::testing;

class ReaderProcess : public ::testing::Test {
 protected:
  void SetUp() override { write_mha(file_, "2 2 1", "MET_UCHAR", "abcd"); }
  void TearDown() override {
    unsetenv("PALPATE_READER");
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child was left";
    EXPECT_EQ(errno, ECHILD);
  }
  /// A shell script in place of palpate-reader; it talks on descriptor 4.
  void pretend(const std::string& script) {
    write_bytes(folder_ / "fake", "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(folder_ / "fake", std::filesystem::perms::owner_all);
    setenv("PALPATE_READER", (folder_ / "fake").c_str(), 1);
  }
  std::string code(const ReaderLimits& limits = {}) {
    try {
      read(file_, {}, {}, limits);
    } catch (const Error& error) {
      text_ = error.what();
      EXPECT_NE(text_.find("scan.mha"), std::string::npos) << text_;
      return error.code();
    }
    return "none";
  }
  static std::string answer(const std::string& dims, const std::string& spacing = "1,1,1", int kept = 1) {
    return R"({"result":{"first_frame":0,"kept_frames":)" + std::to_string(kept) +
           R"(,"volume":{"format":"x","modality":"","sop_class":"","series_uid":"","description":"","date":"","scanner":"","frames":1,"frame_times_s":[],"dims":[)" +
           dims + R"(],"spacing_mm":[)" + spacing +
           R"(],"origin_mm":[0,0,0],"direction":[1,0,0,0,1,0,0,0,1],"components":1,"pixel_type":"uint8","min":0,"max":0,"mean":0,)" +
           R"("provenance":{"spacing":["stated","stated","stated"],"origin":"absent","direction":"absent","time":"absent"},"patient_axes":false,"orientation":"LPS","orientation_choices":[],"warnings":[]}}})";
  }
  static std::string say(const std::string& line) { return "echo '" + line + "' >&4"; }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "scan.mha";
  std::string text_;
};

TEST_F(ReaderProcess, ACrashBecomesAnError) {
  pretend("kill -ABRT $$");
  EXPECT_EQ(code(), "reader-crashed");
  EXPECT_NE(text_.find("SIGABRT"), std::string::npos) << text_;
  pretend("kill -SEGV $$");
  EXPECT_EQ(code(), "reader-crashed");
  pretend("exit 3");
  EXPECT_EQ(code(), "reader-crashed");
}

TEST_F(ReaderProcess, ACrashOfARiskyDecoderIsToldByItsReason) {
  const std::string risk = say(R"({"risk":"scan.mha holds pixels that cannot be decoded: JPEG-LS."})");
  for (const std::string signal : {"ABRT", "SEGV"}) {
    pretend(risk + "; kill -" + signal + " $$");
    EXPECT_EQ(code(), "unsupported");
    EXPECT_EQ(text_, "scan.mha holds pixels that cannot be decoded: JPEG-LS.");
  }
  // Once the decoder has returned, and where it was not the decoder's fault.
  pretend(risk + "; " + say(R"({"risk":""})") + "; kill -ABRT $$");
  EXPECT_EQ(code(), "reader-crashed");
  pretend(risk + "; kill -KILL $$");
  EXPECT_EQ(code(), "reader-memory");
}

TEST_F(ReaderProcess, HandingOverIsMeasured) {
  // Four slices only: that it is done and tidied up, not how fast.
  const auto timing = palpate::imaging::measure_handover(folder_.path(), std::size_t{4} << 20);
  EXPECT_EQ(timing.bytes, std::size_t{4} << 20);
  EXPECT_GT(timing.read_s, 0.0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "handover.mha"));
}

TEST_F(ReaderProcess, AHangEndsWithItsTimeAndTakesItsChildrenAlong) {
  pretend("sleep 1000 & echo $! > " + (folder_ / "grandchild").string() + "; wait");
  ReaderLimits limits;
  limits.time_s = 2.0;  // for a shell to start on a busy machine
  EXPECT_EQ(code(limits), "reader-timeout");
  pid_t grandchild = 0;
  std::ifstream(folder_ / "grandchild") >> grandchild;
  ASSERT_GT(grandchild, 1);
  // A kill takes effect in the kernel's own time; after it, it may wait for init to reap it.
  const auto runs = [&] {
    std::string state;
    std::string skipped;
    std::ifstream stat("/proc/" + std::to_string(grandchild) + "/stat");
    return (stat >> skipped >> skipped >> state) && state != "Z" && state != "X";
  };
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (runs() && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  EXPECT_FALSE(runs());
}

TEST_F(ReaderProcess, TooMuchMemoryBecomesAnError) {
  // 64 MB on the (sparse) file, 256 MB as voxels, 200 MB of address space.
  write_mha(file_, "400 400 400", "MET_UCHAR", "");
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) + 400 * 400 * 400);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // Sanitizers map terabytes of their own.
  pretend("ulimit -v 200000; exec " + (program_folder() / "palpate-reader").string() + " \"$@\"");
  EXPECT_EQ(code(), "reader-memory");
#endif
  pretend("kill -KILL $$");
  EXPECT_EQ(code(), "reader-memory");
  ReaderLimits limits;
  limits.memory_bytes = std::size_t{300} << 20;
  unsetenv("PALPATE_READER");
  EXPECT_EQ(code(limits), "too-large");
}

TEST_F(ReaderProcess, NothingThatItSendsIsBelieved) {
  const std::vector<std::string> lies{
      say("garbage"),
      say("{\"result\":7}"),
      say("[]"),
      say("{\"error\":{\"code\":\"made-up\",\"text\":\"x\"}}"),
      "cat /dev/zero >&4",
      say(answer("2,2,1")),                                 // no voxels at all
      "head -c 15 /dev/zero >&5; " + say(answer("2,2,1")),  // one byte too few
      "head -c 64 /dev/zero >&5; " + say(answer("-2,2,1")),
      "head -c 64 /dev/zero >&5; " + say(answer("2147483647,2147483647,2147483647")),
      "head -c 64 /dev/zero >&5; " + say(answer("2,2,1", "0,1,1")),
      "head -c 64 /dev/zero >&5; " + say(answer("2,2,1", "1,1,1", 2)),
      R"(printf '\377\377\377\377\377\377\377\377\377\377\377\377\377\377\377\377' >&5; )" +
          say(answer("2,2,1")),  // NaN
  };
  for (const auto& lie : lies) {
    pretend(lie);
    EXPECT_EQ(code(), "reader-crashed") << lie;
  }
  pretend("head -c 16 /dev/zero >&5; " + say(answer("2,2,1")));
  EXPECT_EQ(code(), "none");  // the same form, told truly
}

TEST_F(ReaderProcess, CancellingEndsIt) {
  pretend("echo $$ > " + (folder_ / "pid").string() + "; " + say(R"({"progress":0.5,"what":"now"})") +
          "; exec sleep 1000");
  const palpate::core::CancelToken cancel;
  const palpate::core::Progress progress([&](double, const std::string&) { cancel.cancel(); }, cancel);
  try {
    read(file_, {}, progress);
    FAIL() << "it was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), palpate::core::ErrorKind::cancelled);
  }
  pid_t child = 0;
  std::ifstream(folder_ / "pid") >> child;
  ASSERT_GT(child, 1);
  EXPECT_EQ(kill(child, 0), -1);
  EXPECT_EQ(errno, ESRCH);
}

TEST_F(ReaderProcess, AMissingReaderIsSaid) {
  setenv("PALPATE_READER", (folder_ / "nowhere").c_str(), 1);
  EXPECT_THROW(
      {
        try {
          read(file_);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), "reader-missing");
          throw;
        }
      },
      Error);
}

TEST_F(ReaderProcess, ItsChatterDoesNotReachTheUser) {
  pretend("echo noise; echo noise >&2; kill -ABRT $$");
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  const std::string result = code();
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(result, "reader-crashed");
}

TEST_F(ReaderProcess, ByItselfItSaysWhatItIs) {
  const auto result = run_program("palpate-reader", {});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.error.find("started by Palpate"), std::string::npos);
}

TEST_F(ReaderProcess, OneBadFileCostsOnlyItself) {
  // The real reader for MetaImage files, a crash where a DICOM folder is scanned with the bad file in it.
  SmallImage image;
  image.position = "0\\0\\0";
  image.orientation = "1\\0\\0\\0\\1\\0";
  image.write(folder_ / "good.dcm");
  image.instance = "2";
  image.position = "0\\0\\1";
  image.write(folder_ / "also.dcm");
  image.write(folder_ / "bad.dcm");
  const std::string real = (program_folder() / "palpate-reader").string();
  pretend("if grep -aq bad.dcm /proc/self/fd/3; then kill -ABRT $$; fi\nexec " + real + " \"$@\"");
  const auto reports = palpate::imaging::inspect({folder_.path()});
  int good = 0;
  for (const auto& report : reports) {
    if (report.path.filename() == "bad.dcm") {
      EXPECT_EQ(report.error_code, "reader-crashed");
    } else if (report.ok && report.volumes.at(0).format == "DICOM") {
      good += report.volumes.at(0).geometry.dims()[2];
    }
  }
  EXPECT_EQ(good, 2);
}

}  // namespace
