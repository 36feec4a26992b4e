using System;

namespace Gsac
{
    /// <summary>Numbers that something was made of, to see whether it is still so.</summary>
    static class GsacKept
    {
        /// <summary>Copies `now` to `kept`, of the same length; whether they were equal.</summary>
        public static bool Keep<T>(T[] now, T[] kept) where T : struct, IEquatable<T>
        {
            bool same = true;
            for (int i = 0; i < now.Length; i++)
            {
                same &= now[i].Equals(kept[i]);
                kept[i] = now[i];
            }
            return same;
        }
    }
}
