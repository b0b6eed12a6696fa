#include "cli_support.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

namespace palpate::testing {

std::string sample() { return PALPATE_SAMPLE; }

ProgramResult cli(const Words& arguments) { return run_program("palpate-cli", arguments); }

ProgramResult cli_with(const Words& environment, const Words& arguments) {
  Words words = environment;
  words.push_back((program_folder() / "palpate-cli").string());
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_program("/usr/bin/env", words);
}

nlohmann::json cli_json(Words arguments) {
  arguments.push_back("--json");
  const auto result = cli(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(result.signal, 0);
  auto object = nlohmann::json::parse(result.out, nullptr, false);
  EXPECT_TRUE(object.is_object()) << result.out;
  return object;
}

nlohmann::json without_times(nlohmann::json object) {
  for (const char* key : {"wall_s", "ms_per_step", "realtime_factor", "build_s"}) object.erase(key);
  return object;
}

Words small_block() {
  return {sample(), "--threshold", "80", "--crop", "0:40,38:58,25:45", "--min-component", "20"};
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  ASSERT_TRUE(file.good()) << path;
}

std::string pull_gesture(double drag_mm, double seconds, double radius_mm) {
  std::ostringstream text;
  text << R"({"version":1,"steps":[{"tool":"move","radius_mm":)" << radius_mm
       << R"(,"selection":"sphere","cone_half_angle_deg":1,"camera":{"position_mm":[-200,0,0],)"
       << R"("focal_point_mm":[0,0,0],"view_up":[0,0,1],"parallel":true,"parallel_scale_mm":60},)"
       << R"("path":[{"t_s":0,"ray":{"origin_mm":[-200,0,0],"direction":[1,0,0]}},)"
       << R"({"t_s":)" << seconds << R"(,"ray":{"origin_mm":[-200,0,)" << drag_mm
       << R"(],"direction":[1,0,0]}}]}]})";
  return text.str();
}

Words keys_of(const nlohmann::json& object) {
  Words keys;
  for (const auto& [key, unused] : object.items()) keys.push_back(key);
  return keys;
}

bool opencl_present() { return cli({"devices"}).exit_code == 0; }

}  // namespace palpate::testing
