#include <gtest/gtest.h>
#include <plumbline/core/utf8.h>

#include <string>

namespace plumbline {
namespace {

const std::string kNone = "\xEF\xBF\xBD";

TEST(Utf8Test, WellFormedTextStays) {
  for (const std::string text :
       {"", "office.clf.gz", "B\xC3\xBCro", "\xE5\xBB\xBA\xE7\x89\xA9",
        "\xF0\x9F\x8F\xA0", "\xED\x9F\xBF", "\xF4\x8F\xBF\xBF", "<&\">"}) {
    EXPECT_EQ(PrintableUtf8(text), text);
  }
}

TEST(Utf8Test, IllFormedBytesAndControlsAreReplaced) {
  EXPECT_EQ(PrintableUtf8("B\xFCro"), "B" + kNone + "ro");
  EXPECT_EQ(PrintableUtf8("a\x1b[2J\n\t\x7f"),
            "a" + kNone + "[2J" + kNone + kNone + kNone);
  EXPECT_EQ(PrintableUtf8(std::string("\0", 1)), kNone);
  // C1 controls, U+FFFE, U+FFFF.
  EXPECT_EQ(PrintableUtf8("\xC2\x85"), kNone);
  EXPECT_EQ(PrintableUtf8("\xEF\xBF\xBE\xEF\xBF\xBF"), kNone + kNone);
  // Cut off, overlong, a surrogate, past the end.
  EXPECT_EQ(PrintableUtf8("a\xE5\xBB"), "a" + kNone + kNone);
  EXPECT_EQ(PrintableUtf8("\xC0\xAF"), kNone + kNone);
  EXPECT_EQ(PrintableUtf8("\xED\xA0\x80"), kNone + kNone + kNone);
  EXPECT_EQ(PrintableUtf8("\xF4\x90\x80\x80"), kNone + kNone + kNone + kNone);
}

TEST(Utf8Test, LinesKeepTheirEnds) {
  EXPECT_EQ(PrintableLines(""), "");
  EXPECT_EQ(PrintableLines("a\nb"), "a\nb");
  EXPECT_EQ(PrintableLines("\na\x1b[2J\n\xFC\n"),
            "\na\xEF\xBF\xBD[2J\n\xEF\xBF\xBD\n");
}

TEST(Utf8Test, ByteOrderMark) {
  std::string text =
      "\xEF\xBB\xBF"
      "a\xEF\xBB\xBF";
  RemoveByteOrderMark(&text);
  EXPECT_EQ(text, "a\xEF\xBB\xBF");
  text = "\xEF\xBB";
  RemoveByteOrderMark(&text);
  EXPECT_EQ(text, "\xEF\xBB");
}

}  // namespace
}  // namespace plumbline
