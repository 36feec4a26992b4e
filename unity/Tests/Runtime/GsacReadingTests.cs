using System;
using System.Globalization;
using System.Threading;
using NUnit.Framework;

namespace Gsac.Tests
{
    /// <summary>What needs no scene: files that are none, reports that every program can read.</summary>
    public sealed class GsacReadingTests
    {
        [Test]
        public void WhatIsNoAvatarIsRefusedByName()
        {
            var found = Assert.Throws<GsacException>(() => GsacData.Read(new byte[64]));
            Assert.AreEqual(GsacFault.NotGsac, found.Fault);
            StringAssert.Contains("people/ada.gsac", new GsacException("people/ada.gsac", found).Message);
        }

        [Test]
        public void ReportsAreJsonWhateverTheLanguageOfTheMachine()
        {
            CultureInfo usual = Thread.CurrentThread.CurrentCulture;
            Thread.CurrentThread.CurrentCulture = new CultureInfo("de-DE");
            try
            {
                var report = new GsacReport();
                report.Add("gpu", "a \"good\" one");
                report.Add("seconds", 1.5);
                report.Add("editor", true);
                report.Add("rates", new[] { 60, 72, 0 }, 2);
                Assert.AreEqual("{\"gpu\": \"a \\\"good\\\" one\", \"seconds\": 1.5, \"editor\": true, \"rates\": [60, 72]}", report.ToString());
            }
            finally
            {
                Thread.CurrentThread.CurrentCulture = usual;
            }
        }
    }
}
