using System;

namespace Gsac
{
    /// <summary>What is wrong with a .gsac file; every reader, in whatever language, uses these names.</summary>
    public enum GsacFault
    {
        NotGsac,
        Version,
        Truncated,
        Oversized,
        Checksum,
        Head,
        Block,
        Value,
    }

    /// <summary>A .gsac file cannot be read. Fault names the kind, the message says what was found.</summary>
    public sealed class GsacException : Exception
    {
        public GsacFault Fault { get; private set; }

        public GsacException(GsacFault fault, string detail)
            : base("not a usable avatar (" + Word(fault) + "): " + detail)
        {
            Fault = fault;
        }

        /// <summary>The same, of a file that has a name.</summary>
        public GsacException(string file, GsacException found)
            : base(file + ": " + found.Message, found)
        {
            Fault = found.Fault;
        }

        /// <summary>The name in docs/gsac-format.md.</summary>
        public static string Word(GsacFault fault)
        {
            return fault == GsacFault.NotGsac ? "not_gsac" : fault.ToString().ToLowerInvariant();
        }
    }
}
