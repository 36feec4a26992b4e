using System;

namespace Gsac
{
    /// <summary>One picture of Unity's beside the one that the file asks for.</summary>
    public sealed class GsacCheckedView
    {
        public string Name;

        /// <summary>`mono`, or how a headset's two eyes are drawn.</summary>
        public string Mode;

        /// <summary>Likeness, of the pixels where the person is or should be; 99 at most.</summary>
        public double Decibels;

        /// <summary>Shares of the picture: where the person should be, and where something is.</summary>
        public double PersonShare, DrawnShare;

        public GsacReport Report()
        {
            var row = new GsacReport();
            row.Add("view", Name);
            row.Add("mode", Mode);
            row.Add("decibels", Math.Round(Decibels, 2));
            row.Add("person_share", Math.Round(PersonShare, 4));
            row.Add("drawn_share", Math.Round(DrawnShare, 4));
            return row;
        }
    }
}
