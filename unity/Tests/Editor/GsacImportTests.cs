using NUnit.Framework;
using UnityEngine;

namespace Gsac.Tests
{
    /// <summary>Each person of the project is what an imported file should be; without one there is nothing to look at.</summary>
    public sealed class GsacImportTests
    {
        [Test]
        public void EachPersonIsAHumanoid()
        {
            foreach (GsacAvatar person in People())
            {
                Avatar avatar = person.GetComponent<Animator>().avatar;
                Assert.IsTrue(avatar != null && avatar.isValid && avatar.isHuman, person.name);
            }
        }

        [Test]
        public void EachPersonStandsOnTheFloorAndIsFramedWhole()
        {
            foreach (GsacAvatar person in People())
            {
                Bounds whole = GsacSceneBounds.Of(person);
                Assert.Greater(whole.size.y, 0.5f, person.name);
                Assert.Less(System.Math.Abs(whole.center.y - whole.size.y / 2), 0.3f, person.name);
            }
        }

        static GsacAvatar[] People()
        {
            GsacAvatar[] people = GsacCastFiller.FindPeople();
            if (people.Length == 0) Assert.Ignore("nobody in this project: drag an avatar.gsac into it");
            return people;
        }
    }
}
