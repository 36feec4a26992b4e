using System;

namespace Gsac
{
    /// <summary>Parts of a person that may be moved by different things at once.</summary>
    [Flags]
    public enum GsacParts
    {
        /// <summary>Expressions, jaw and eyes.</summary>
        Face = 1,
        /// <summary>The fingers; wrists go with the arms.</summary>
        Hands = 2,
        /// <summary>All other joints and the place of the whole.</summary>
        Body = 4,
        All = Face | Hands | Body,
    }
}
