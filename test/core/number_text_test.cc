#include <gtest/gtest.h>
#include <plumbline/core/number_text.h>

#include <cstdint>
#include <map>
#include <string>

namespace plumbline {
namespace {

TEST(ParseNumberTest, Doubles) {
  double value = 7.0;
  for (const auto& [text, expected] : std::map<std::string, double>{
           {"0.5", 0.5},
           {"+0.5", 0.5},
           {"-2e3", -2000.0},
           {"1e-400", 0.0},
           {"-1E-400", 0.0},
           {"4.9e-324", 4.9e-324},
           {"1.7976931348623157e308", 1.7976931348623157e308}}) {
    EXPECT_TRUE(ParseNumber(text, &value)) << text;
    EXPECT_EQ(value, expected) << text;
  }
  for (const std::string text : {"", "+", "+-1", "1e400", "-1e400", "1e+400",
                                 "1x", "1e-400x", "0x10", " 1", "1 "}) {
    EXPECT_FALSE(ParseNumber(text, &value)) << text;
  }
}

TEST(ParseNumberTest, WholeNumbers) {
  std::int64_t value = 0;
  EXPECT_TRUE(ParseNumber("+9223372036854775807", &value));
  EXPECT_EQ(value, INT64_MAX);
  EXPECT_FALSE(ParseNumber("9223372036854775808", &value));
  EXPECT_FALSE(ParseNumber("1.0", &value));
}

}  // namespace
}  // namespace plumbline
