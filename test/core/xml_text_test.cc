#include <gtest/gtest.h>
#include <plumbline/core/xml_text.h>

namespace plumbline {
namespace {

TEST(XmlTextTest, EscapesWhatXmlReads) {
  EXPECT_EQ(EscapeXml(""), "");
  EXPECT_EQ(EscapeXml("a < b & c > \"d\""),
            "a &lt; b &amp; c &gt; &quot;d&quot;");
  EXPECT_EQ(EscapeXml("&amp;"), "&amp;amp;");
}

TEST(XmlTextTest, ReplacesWhatXmlCannotHold) {
  EXPECT_EQ(EscapeXml("a\x01\xFF<"), "a\xEF\xBF\xBD\xEF\xBF\xBD&lt;");
}

}  // namespace
}  // namespace plumbline
