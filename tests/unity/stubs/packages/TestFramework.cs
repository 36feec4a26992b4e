// Stands for what the package's own tests take from com.unity.test-framework and its NUnit 3.
using System;

namespace NUnit.Framework
{
    [AttributeUsage(AttributeTargets.Method)] public sealed class TestAttribute : Attribute { }
    public sealed class IgnoreException : Exception { public IgnoreException(string message) : base(message) { } }
    public sealed class AssertionException : Exception { public AssertionException(string message) : base(message) { } }

    public static class Assert
    {
        public static void Ignore(string message) { throw new IgnoreException(message); }
        public static void IsTrue(bool condition, string message) { Hold(condition, message); }
        public static void Greater(double arg1, double arg2, string message) { Hold(arg1 > arg2, message + ": " + arg1 + " > " + arg2); }
        public static void Less(double arg1, double arg2, string message) { Hold(arg1 < arg2, message + ": " + arg1 + " < " + arg2); }
        public static void AreEqual(object expected, object actual) { Hold(Equals(expected, actual), expected + " is not " + actual); }
        public static T Throws<T>(Action code) where T : Exception
        {
            try
            {
                code();
            }
            catch (T e)
            {
                return e;
            }
            throw new AssertionException("nothing was thrown");
        }
        internal static void Hold(bool holds, string message) { if (!holds) throw new AssertionException(message); }
    }

    public static class StringAssert
    {
        public static void Contains(string expected, string actual) { Assert.Hold(actual.Contains(expected), actual); }
    }
}

namespace UnityEngine.TestTools
{
    [AttributeUsage(AttributeTargets.Method)] public sealed class UnityTestAttribute : Attribute { }
}
