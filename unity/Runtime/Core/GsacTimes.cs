using System;

namespace Gsac
{
    /// <summary>Frame times as a histogram of fixed size, so that ten minutes of them allocate nothing.</summary>
    public sealed class GsacTimes
    {
        const double Bin = 1e-5; // s
        readonly int[] bins = new int[100001]; // the last holds all above 1 s

        public int Count { get; private set; }
        public double Sum { get; private set; }

        public void Add(double seconds)
        {
            bins[(int)Math.Min(Math.Max(seconds, 0) / Bin, bins.Length - 1)]++;
            Count++;
            Sum += seconds;
        }

        /// <summary>The time, s, that `part` (0..1) of the frames stay below, to 0.01 ms.</summary>
        public double Quantile(double part)
        {
            long rank = (long)Math.Ceiling(part * Count), seen = 0;
            for (int i = 0; i < bins.Length; i++)
            {
                seen += bins[i];
                if (seen >= rank && seen > 0) return (i + 0.5) * Bin;
            }
            return 0;
        }
    }
}
