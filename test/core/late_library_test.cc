#include <gtest/gtest.h>
#include <math.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>

#include <string>

namespace plumbline {

// libm is there wherever the tests run. `j1` is Bessel's function,
// which nothing else here calls.
inline LateLibrary math_library("libm.so.6");
PLUMBLINE_LATE_FUNCTION(math_library, j1);
PLUMBLINE_LATE_FUNCTION(math_library, lgamma_r);
inline LateLibrary absent_library("libplumbline_absent.so.0");
PLUMBLINE_LATE_FUNCTION(absent_library, y1);

namespace {

std::string MessageOf(double (*call)()) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(LateLibrary, CallsTheFunctionOfTheLibrary) {
  // Abramowitz and Stegun, table 9.1. The argument is converted as the header
  // says: an int becomes a double.
  EXPECT_NEAR(j1(1), 0.4400505857, 1e-10);
  EXPECT_NEAR(j1(1.0), 0.4400505857, 1e-10);
}

TEST(LateLibrary, PassesWhereToWrite) {
  // gamma(-0.5) = -2 sqrt(pi).
  int sign = 0;
  EXPECT_NEAR(lgamma_r(-0.5, &sign), 1.2655121235, 1e-10);
  EXPECT_EQ(sign, -1);
}

TEST(LateLibrary, NamesTheLibraryThatIsNotThere) {
  const std::string message = MessageOf([] { return y1(1.0); });
  EXPECT_NE(message.find("loading libplumbline_absent.so.0: "),
            std::string::npos)
      << message;
  EXPECT_NE(message.find("expected the library, installed"), std::string::npos)
      << message;
}

TEST(LateLibrary, NamesTheFunctionThatIsNotThere) {
  LateLibrary library("libm.so.6");
  try {
    library.Find("plumbline_no_such_function");
    FAIL() << "expected an error";
  } catch (const Error& error) {
    const std::string message = error.what();
    EXPECT_NE(message.find("plumbline_no_such_function"), std::string::npos)
        << message;
    EXPECT_NE(message.find("libm.so.6"), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace plumbline
